"""Bundle adjustment: two solvers, one problem each.

GTSAM (`bundle`) makes the initial solution: poses and points of a sample of the joints, by a sparse
Levenberg-Marquardt, once from each start that is tried (`starts`). It knows the tape and the pixels.

The adjustment itself (`adjustment`, solved by `reduced`) begins there and solves what GTSAM has not seen: all joints,
without the detections that disagree, with the metric facts of the session (`facts`) as measurements of the cameras. A
fact is one measurement however many thousand points it speaks of; as a factor of GTSAM's it would tie all these points
together, and they could no longer be eliminated one by one. Its normal matrix is the cameras' information, from which
`uncertainty` makes their covariance; GTSAM's marginals assume white noise, which a detector's is not.

GTSAM is also what `reduced` is held equal to: tests/calibrate/bundle/test_gtsam.py builds the whole problem out of
GTSAM's factors (projections with Huber's loss, tape, ranges between cameras and to points, a mean length, a tag) and
compares the optimum, and the covariance with `gtsam.Marginals`.
"""
