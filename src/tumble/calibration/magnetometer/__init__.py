"""The magnetometer of an IMU: from the holds and turns that tell both other triads, or by itself."""
