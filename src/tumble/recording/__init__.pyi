from .columns import (
    ColumnPlan as ColumnPlan,
    DeclaredUnits as DeclaredUnits,
    plan_from_names as plan_from_names,
    renamed as renamed,
    role_of as role_of,
)
from .doctor import (
    Findings as Findings,
    find_dead_channels as find_dead_channels,
    find_saturated_channels as find_saturated_channels,
    inspect_recording as inspect_recording,
    say_field as say_field,
)
from .formats import (
    FORMATS as FORMATS,
    find_format as find_format,
    header_names as header_names,
    read_table as read_table,
)
from .formats.bags.bag import (
    Bag as Bag,
    Choice as Choice,
    Decoded as Decoded,
    Topic as Topic,
    batches as batches,
    choose_topics as choose_topics,
    decode as decode,
    substituted as substituted,
)
from .formats.bags.files import opened_bag as opened_bag
from .formats.folder import euroc_file as euroc_file, rank_sensor as rank_sensor
from .formats.frames import Frame as Frame, frame_names as frame_names
from .formats.lines import (
    COMMENTS as COMMENTS,
    LONGEST_LINE as LONGEST_LINE,
    Row as Row,
    row_of as row_of,
    without_clock as without_clock,
    words_of as words_of,
)
from .formats.logs.own_parameters import UNSTATED as UNSTATED
from .formats.output import (
    PLACE as PLACE,
    TABLE_ENDINGS as TABLE_ENDINGS,
    column_names as column_names,
    data_frame as data_frame,
    euroc_corrections as euroc_corrections,
    write_blocks as write_blocks,
    write_euroc as write_euroc,
    write_recording as write_recording,
    write_table as write_table,
)
from .formats.streams import Merging as Merging
from .formats.table import RawTable as RawTable, hash_file as hash_file
from .formats.text import names_of_sentence as names_of_sentence
from .gravity_check import (
    describe_axis_contradiction as describe_axis_contradiction,
    find_axis_contradiction as find_axis_contradiction,
    find_steps_of_two as find_steps_of_two,
    unit_of_scale as unit_of_scale,
)
from .reading import (
    Asked as Asked,
    Paths as Paths,
    choose_columns as choose_columns,
    interpret as interpret,
    read_blocks as read_blocks,
    read_recording as read_recording,
    read_recordings as read_recordings,
    recording_inputs as recording_inputs,
)
from .recording import Recording as Recording
from .rest import (
    block_statistics as block_statistics,
    fit_sphere as fit_sphere,
    limits_reached as limits_reached,
    sample_pieces as sample_pieces,
    smallest_step as smallest_step,
)
from .rewriting import (
    BAG_ENDINGS as BAG_ENDINGS,
    Exchange as Exchange,
    corrections as corrections,
    ending_of as ending_of,
    write_anew as write_anew,
)
from .samples import (
    NOTHING_MADE as NOTHING_MADE,
    MagneticField as MagneticField,
    Remark as Remark,
    Samples as Samples,
    Source as Source,
    joined as joined,
    joined_fields as joined_fields,
)
from .stamps import (
    NOMINAL as NOMINAL,
    BlockState as BlockState,
    Clock as Clock,
    clock_of_stamps as clock_of_stamps,
    clock_without_stamps as clock_without_stamps,
    exact_clock as exact_clock,
    find_gaps as find_gaps,
    stamp_jitter as stamp_jitter,
)
from .temperature import (
    LONG_GAP as LONG_GAP,
    POSSIBLE_CELSIUS as POSSIBLE_CELSIUS,
    TemperatureColumn as TemperatureColumn,
    mean_celsius as mean_celsius,
)
from .units import Interpretation as Interpretation, read_units_option as read_units_option
