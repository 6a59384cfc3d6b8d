"""Faults of the machine: kills at any moment, disks that fail at any write; earlier results stay whole.

python -m tests.faults --kills 200
"""
