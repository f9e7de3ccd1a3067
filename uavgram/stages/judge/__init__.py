"""Stage: judge the fit of every length, pick, prior and check, and effects of undetected errors."""

from uavgram.stages.judge.checks import compare_withheld as compare_withheld
from uavgram.stages.judge.checks import judge_overall as judge_overall
from uavgram.stages.judge.checks import judge_points as judge_points
from uavgram.stages.judge.fit import Fit as Fit
from uavgram.stages.judge.fit import compute_fit as compute_fit
from uavgram.stages.judge.fit import judge_fit as judge_fit
from uavgram.stages.judge.fit import judge_groups as judge_groups
from uavgram.stages.judge.fit import judge_majority as judge_majority
from uavgram.stages.judge.known import judge_control_lines as judge_control_lines
from uavgram.stages.judge.known import judge_known as judge_known
from uavgram.stages.judge.lines import judge_lines as judge_lines
from uavgram.stages.judge.picks import judge_makers as judge_makers
from uavgram.stages.judge.picks import judge_picks as judge_picks
from uavgram.stages.judge.suspects import judge_removals as judge_removals
from uavgram.stages.judge.suspects import judge_rivals as judge_rivals
from uavgram.stages.judge.suspects import judge_suspects as judge_suspects
from uavgram.stages.judge.tested_survey import TestedSurvey as TestedSurvey
from uavgram.stages.judge.tested_survey import run_tests as run_tests
from uavgram.stages.judge.unchecked import judge_priors as judge_priors
from uavgram.stages.judge.unchecked import judge_unchecked as judge_unchecked
from uavgram.stages.judge.unchecked import judge_weakest as judge_weakest
from uavgram.stages.judge.verdict import contradicts_result as contradicts_result
from uavgram.stages.judge.verdict import determine_verdict as determine_verdict
