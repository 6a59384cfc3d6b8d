from .calibration import (
    FOOTNOTE as FOOTNOTE,
    PREDICTED as PREDICTED,
    FilterDocument as FilterDocument,
    StateBlock as StateBlock,
    calibration_page as calibration_page,
    cells as cells,
    next_steps as next_steps,
    planned_sentence as planned_sentence,
    render_report as render_report,
)
from .drive import metres as metres, render_drive as render_drive
from .evidence import render_evidence as render_evidence
from .figures.on_page import plot as plot
from .figures.on_paper import (
    FORMS as FORMS,
    require_library as require_library,
    write_figures as write_figures,
)
from .fleet import (
    batch_page as batch_page,
    change_table as change_table,
    history_page as history_page,
    history_table as history_table,
)
from .html import LIBRARY as LIBRARY, plotting_library as plotting_library, render_page as render_page
from .noise import (
    curve_lines as curve_lines,
    noise_lines as noise_lines,
    noise_page as noise_page,
    triad_lines as triad_lines,
)
from .noise_document import (
    NoiseDocument as NoiseDocument,
    document_text as document_text,
    noise_document as noise_document,
)
from .operator_sheet import render_sheet as render_sheet
from .page import Page as Page, print_blocks as print_blocks
from .parameters import (
    achieved_beside as achieved_beside,
    headed_table as headed_table,
    parameter_rows as parameter_rows,
    practical_uncertainties as practical_uncertainties,
    rows_of as rows_of,
)
from .reproduction import (
    outcome_files as outcome_files,
    outcome_json as outcome_json,
    outcome_lines as outcome_lines,
)
from .subject import Subject as Subject
from .summary import print_calibration as print_calibration, verdict_line as verdict_line
from .words import limits_verdict as limits_verdict
