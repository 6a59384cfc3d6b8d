"""Bags: files of messages with topics, as the recorders of ROS write them, read without ROS."""
