"""What a user asks for, end to end: inspect, calibrate, apply, verify, demonstrate; one module each.

A workflow is imported from its module (``from tumble.workflows.calibrate import calibrate``): the package
itself offers no names, because they would be those of its modules.
"""
