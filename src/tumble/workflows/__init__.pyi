from .apply import apply as apply
from .batch import run_batch as run_batch
from .calibrate import calibrate as calibrate, demo as demo
from .convert import (
    Converted as Converted,
    convert_from as convert_from,
    convert_to as convert_to,
    list_targets as list_targets,
    turn as turn,
)
from .difference import (
    difference as difference,
    is_truth as is_truth,
    recovery as recovery,
    verdict as verdict,
)
from .drive import DriveVerification as DriveVerification, verify_drive as verify_drive
from .given import choose_site as choose_site, read_given_protocol as read_given_protocol
from .inspect import Inspection as Inspection, inspect as inspect
from .mount import Mounted as Mounted, mount as mount
from .noise import (
    NoiseAnalysis as NoiseAnalysis,
    analyse_noise as analyse_noise,
    read_noise_models as read_noise_models,
)
from .plan import (
    DEFAULTS as DEFAULTS,
    STEP_HEADS as STEP_HEADS,
    Planned as Planned,
    document_of as document_of,
    headline as headline,
    next_words as next_words,
    plan as plan,
    prediction_rows as prediction_rows,
    scheme_rows as scheme_rows,
    step_rows as step_rows,
)
from .predict import (
    predict as predict,
    states_document as states_document,
    straight_course as straight_course,
    write_states as write_states,
)
from .procedures import (
    add_remarks as add_remarks,
    find_estimator as find_estimator,
    run_procedure as run_procedure,
)
from .registry import (
    BASELINE as BASELINE,
    SHORTEST_HISTORY as SHORTEST_HISTORY,
    History as History,
    add_calibration as add_calibration,
    add_files as add_files,
    date_words as date_words,
    due_units as due_units,
    fleet as fleet,
    history as history,
    history_rows as history_rows,
    make_certificate as make_certificate,
    registry_at as registry_at,
    require_registry as require_registry,
)
from .reproduce import reproduce as reproduce
from .request import (
    ADVANCED as ADVANCED,
    ARGUMENT as ARGUMENT,
    FILE as FILE,
    FIRST as FIRST,
    OF_NO_DRIVE as OF_NO_DRIVE,
    PLACE as PLACE,
    RECORD as RECORD,
    ApplyRequest as ApplyRequest,
    CalibrateRequest as CalibrateRequest,
    CertificateRequest as CertificateRequest,
    ConvertRequest as ConvertRequest,
    DriveRequest as DriveRequest,
    InspectRequest as InspectRequest,
    MountRequest as MountRequest,
    NoiseRequest as NoiseRequest,
    PlanRequest as PlanRequest,
    PredictRequest as PredictRequest,
    ReproduceRequest as ReproduceRequest,
    SimulateRequest as SimulateRequest,
    StreamRequest as StreamRequest,
    UnitRequest as UnitRequest,
    VerifyRequest as VerifyRequest,
    argument as argument,
    listed_words as listed_words,
    notes_of as notes_of,
    numbers as numbers,
    option as option,
    option_of as option_of,
    refuse as refuse,
    shared as shared,
    words_of as words_of,
)
from .results import CalibrationRun as CalibrationRun
from .simulate import Simulated as Simulated, simulate as simulate
from .verify import Verification as Verification, verify as verify
