from .content import certificate_content as certificate_content
from .dcc import dcc_text as dcc_text
from .pdf import certificate_pdf as certificate_pdf
from .profile import Laboratory as Laboratory, Profile as Profile, read_profile as read_profile
