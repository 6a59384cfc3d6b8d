"""Certificates of a calibration: a PDF for people, and PTB's digital calibration certificate for machines.

Both carry the ``calibration.json`` that they are of, whole, so that every number in them can be compared with it.
"""

from tumble.certificate.content import CertificateContent, certificate_content
from tumble.certificate.pdf import certificate_pdf
from tumble.certificate.profile import Profile, read_profile

__all__ = [
    "CertificateContent",
    "Profile",
    "certificate_content",
    "certificate_pdf",
    "read_profile",
]
