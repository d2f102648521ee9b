"""The diagnosis and what follows from it: document, where, next poses, prediction."""

from postproc.gap.answers.along import Along, along
from postproc.gap.answers.calibrated import calibrated_urdf
from postproc.gap.answers.certificate import certificate
from postproc.gap.answers.diagnose import Diagnosis, diagnose
from postproc.gap.answers.document import document, model_file
from postproc.gap.answers.kept import Kept, kept
from postproc.gap.answers.next_pose import APPROACH, NextPose, Reach
from postproc.gap.answers.next_poses import last_set_up, next_poses, questions, reassessed
from postproc.gap.answers.outlook import Outlook, outlook
from postproc.gap.answers.predict import Prediction, predict
from postproc.gap.answers.promise import Open, Promise
from postproc.gap.answers.summary import is_ambiguous, noise_like, noise_words, summary
from postproc.gap.answers.where import Part, parts
