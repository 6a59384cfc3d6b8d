from .composition import calibration_from_estimate as calibration_from_estimate
from .corrector import NO_TEMPERATURE as NO_TEMPERATURE, Corrector as Corrector
from .difference import (
    Difference as Difference,
    ParameterChange as ParameterChange,
    compare_calibrations as compare_calibrations,
)
from .entries import (
    PLACES as PLACES,
    entry_names as entry_names,
    model_of_vector as model_of_vector,
    named_parameters as named_parameters,
    parameter_vector as parameter_vector,
    put as put,
    stacked as stacked,
    term_of as term_of,
    turned_to as turned_to,
    vector_of_model as vector_of_model,
)
from .imported import calibration_from_model as calibration_from_model
from .magnetometer_block import (
    FIELD_ALONE as FIELD_ALONE,
    FieldParameter as FieldParameter,
    MagnetometerBlock as MagnetometerBlock,
)
from .part import (
    DocumentPart as DocumentPart,
    finite as finite,
    part_of as part_of,
    plain as plain,
    read_part as read_part,
    refusal as refusal,
    row_of as row_of,
    rows_of as rows_of,
    schema_of as schema_of,
    spelled as spelled,
)
from .predictions import Answer as Answer, answers as answers, practical as practical
from .reading import read_calibration as read_calibration
from .result import (
    BACKWARD as BACKWARD,
    FORWARD as FORWARD,
    BiasBlock as BiasBlock,
    Calibration as Calibration,
    Decision as Decision,
    LimitBlock as LimitBlock,
    LimitsBlock as LimitsBlock,
    ParameterBlock as ParameterBlock,
    RecordingName as RecordingName,
    Rule as Rule,
    StableBlock as StableBlock,
    TermBlock as TermBlock,
    TriadBlock as TriadBlock,
    TurnOnsBlock as TurnOnsBlock,
    VerdictBlock as VerdictBlock,
    calibration_html as calibration_html,
    calibration_of as calibration_of,
    turn_ons_block as turn_ons_block,
)
from .soundness import is_invertible as is_invertible
from .thermal_block import ThermalBlock as ThermalBlock, thermal_block as thermal_block
