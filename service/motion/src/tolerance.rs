//! Every tolerance of the crate, each with its reason.

/// Largest angle between the tangents of two elements that counts as tangent, rad. Posts round arc ends and
/// centres to 0.001 mm or 0.0001 mm: a fillet of 1 mm radius then meets its line at up to about 1e-3 rad.
/// The velocity step that is left is limited separately, so that accelerations hold whatever the angle.
pub const TANGENT_TOLERANCE_RAD: f64 = 1e-3;

/// Largest gap between the end of one element and the start of the next that still counts as the same point,
/// mm: re-expressing a point in other work coordinates rounds it.
pub(crate) const SAME_POINT_MM: f64 = 1e-9;

/// Beyond this radius positions on a circle are taken from its start, mm: angles round to 1e-15 rad, which is 1e-11 mm
/// here and would be more than the 1e-9 mm of a position at a hundred times the radius.
pub(crate) const HUGE_RADIUS_MM: f64 = 1e4;

/// Under constant surface speed the commanded speed is held within stretches in which the programmed one
/// changes by at most this factor, so that the feed per revolution is never exceeded and at most 1 % short.
pub(crate) const SURFACE_SPEED_STEP: f64 = 1.01;

/// Most stretches of one element: the ratio of largest to smallest radius that 1 % steps can cover is 2·10⁸.
pub(crate) const MAX_STRETCHES: usize = 2_048;

/// Most turns of |X| within one stretch.
pub(crate) const MAX_TURNS_PER_STRETCH: usize = 64;

/// Angles closer than this are the same place of an arc, rad: rounding of angles is below 1e-15, and a circle's X
/// changes by less than 1e-12 of its radius on the way.
pub(crate) const SAME_ANGLE_RAD: f64 = 1e-12;

/// Share of an axis' acceleration that the centripetal part v²κ may use on a curve; see `limits`.
pub(crate) const CENTRIPETAL_SHARE: f64 = 0.8;
/// Share of an axis' acceleration left for the tangential part on a curve: tangent and normal are orthogonal, so
/// √(0.8² + 0.6²) = 1 is never exceeded on any axis.
pub(crate) const TANGENTIAL_SHARE: f64 = 0.6;
/// Share of an axis' jerk along the tangent on a curve, for the jerk of the feed and the v³κ² of the turning
/// together; the normal part 3·v·a·κ gets the orthogonal rest, 0.6.
pub(crate) const TANGENT_JERK_SHARE: f64 = 0.8;
/// Share of an axis' jerk along the normal on a curve.
pub(crate) const NORMAL_JERK_SHARE: f64 = 0.6;
/// Share of [`TANGENT_JERK_SHARE`] that turning alone (v³κ²) may use, so that some is left to change the feed.
pub(crate) const TURNING_JERK_SHARE: f64 = 0.5;

/// Part of a limit that must be left for the feed when a vibration is superposed: with less the feed could not
/// start or stop in reasonable time, and the vibration is refused instead.
pub(crate) const LEAST_FEED_SHARE: f64 = 0.02;

/// Most steps of a profile's speed solver: more than bisection alone would need for every bit of a double.
pub(crate) const SOLVER_STEPS: usize = 64;
/// Relative precision of a solved speed: it costs 1e-12 of the time of a change of speed, far below a nanosecond.
pub(crate) const SOLVER_PRECISION: f64 = 1e-12;
/// Relative shortfall of a length that is put down to the solver's precision when a window is planned again.
pub(crate) const SOLVER_SLACK: f64 = 1e-9;

/// Share of an axis' acceleration that the change of direction at a tangent junction may use. The elements beside it
/// leave ten times the share that is used, and a curve needs that: √(0.8² + (0.6·(1 − 10·u))²) + u ≤ 1 up to u = 0.05.
pub(crate) const KINK_ACCELERATION_SHARE: f64 = 0.05;
/// Share of an axis' jerk that the change of direction at a tangent junction may use.
pub(crate) const KINK_JERK_SHARE: f64 = 0.1;
/// Share of an axis' jerk that the change of curvature at a tangent junction may use. Together with the change of
/// direction, u ≤ 0.5, it stays within what a curve's elements leave when their feed changes with (1 − u) of its
/// limits: √((0.8·(1 − u) + 0.4·u)² + (0.6·(1 − u) + u)²) ≤ 1.
pub(crate) const BEND_JERK_SHARE: f64 = 0.4;
/// Most that the elements beside a junction leave free for it.
pub(crate) const LARGEST_RESERVE: f64 = KINK_JERK_SHARE + BEND_JERK_SHARE;
