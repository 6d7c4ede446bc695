from .certificate import Certificate, read_certificate, write_certificate
from .plants import RobotVariant, robot_variants, select_variants
from .report import certificate_table, write_certificate_page
from .run import CertifyOptions, certify_controller
from .thresholds import Thresholds

__all__ = [
    "Certificate",
    "CertifyOptions",
    "RobotVariant",
    "Thresholds",
    "certificate_table",
    "certify_controller",
    "read_certificate",
    "robot_variants",
    "select_variants",
    "write_certificate",
    "write_certificate_page",
]
