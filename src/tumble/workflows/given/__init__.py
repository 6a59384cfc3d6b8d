"""What a user gives beside the recording: place, notes, protocol, data sheet, noise models."""
