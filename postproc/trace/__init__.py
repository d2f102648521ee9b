"""The gap along a path: from what a controller recorded to its causes."""

from postproc.trace.answer import PathDiagnosis
from postproc.trace.contour import LONGEST
from postproc.trace.document import REST, document, model_file, summary
from postproc.trace.effect import JOINTS, PATH_EFFECTS, known_effects
from postproc.trace.planner import PLANNER
from postproc.trace.program import of_program, of_toolpath
from postproc.trace.reading import TRACES, read_recording
from postproc.trace.recording import Recording
from postproc.trace.scene import Scene, Stage
