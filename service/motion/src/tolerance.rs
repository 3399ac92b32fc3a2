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
/// changes by less than 1e-12 of its radius along it.
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
pub const LEAST_FEED_SHARE: f64 = 0.02;

/// Most steps of a profile's speed solver: more than bisection alone would need for every bit of a double.
pub(crate) const SOLVER_STEPS: usize = 64;
/// Relative precision of a solved speed: it costs 1e-12 of the time of a change of speed, far below a nanosecond.
pub(crate) const SOLVER_PRECISION: f64 = 1e-12;
/// Relative shortfall of a length that is put down to the solver's precision when a window is planned again.
pub(crate) const SOLVER_SLACK: f64 = 1e-9;

/// Relative precision of the time at which a profile passes a position: some ulps of the phase.
pub(crate) const TIME_PRECISION: f64 = 1e-15;

/// Commanded speeds that differ by no more than this share count as one, so that a feed in inverse time, rounded in
/// every block, does not divide a path: a fifth of a percent is below what a drive shows. It lies below a step of
/// [`SURFACE_SPEED_STEP`], so that the feed per revolution stays exact under constant surface speed.
pub(crate) const SAME_COMMAND: f64 = 2e-3;

/// Share of an axis' jerk that the change of direction at a junction may use where the path accelerates through it.
pub(crate) const KINK_RAMP_SHARE: f64 = 0.05;

/// Share of an axis' acceleration that the change of direction at a tangent junction may use. The elements beside it
/// leave ten times the share that is used, and a curve needs that: √(0.8² + (0.6·(1 − 10·u))²) + u ≤ 1 up to u = 0.05.
pub(crate) const KINK_ACCELERATION_SHARE: f64 = 0.05;
/// Share of an axis' jerk that the change of direction at a tangent junction may use.
pub(crate) const KINK_JERK_SHARE: f64 = 0.1;
/// Share of an axis' jerk that the change of curvature at a tangent junction may use. Together with the change of
/// direction, u ≤ 0.5, it stays within what a curve's elements leave when their feed changes with (1 − u) of its
/// limits: √((0.8·(1 − u) + 0.4·u)² + (0.6·(1 − u) + u)²) ≤ 1.
pub(crate) const BEND_JERK_SHARE: f64 = 0.35;
/// Most that the elements beside a junction leave free for it.
pub(crate) const LARGEST_RESERVE: f64 = KINK_JERK_SHARE + BEND_JERK_SHARE + KINK_RAMP_SHARE;

/// Highest degree of a spline: order 10, more than any controller takes.
pub(crate) const MAX_SPLINE_DEGREE: usize = 9;
/// Most polynomial pieces of a spline, and most spans: 4 MB. An ordinary curve needs some eight per turn of direction.
pub(crate) const MAX_SPLINE_PIECES: usize = 16_384;
/// Most times that a span is halved: a place that still cannot be fitted in a 2⁻³⁰th of its span is a cusp.
pub(crate) const MAX_SPLINE_HALVINGS: u32 = 30;
/// Largest distance of a spline's polynomials from the curve where it is measured, mm: a tenth of what is promised, as it is
/// measured at three points.
pub(crate) const SPLINE_FIT_MM: f64 = 1e-10;
/// Largest difference of a spline's tangents from the curve's where they are measured.
pub(crate) const SPLINE_FIT_TANGENT: f64 = 1e-10;
/// Relative difference of two quadratures of the length, the second of which is 10⁸ times as exact as the first.
pub(crate) const SPLINE_QUADRATURE: f64 = 1e-6;
/// Rounding of positions relative to the largest coordinate: some tens of units in the last place.
pub(crate) const SPLINE_ROUNDING: f64 = 4e-15;
/// Control points closer than this to a line are on it, mm, and extremes of position are found to this.
pub(crate) const SPLINE_STRAIGHT_MM: f64 = 1e-12;
/// Steps of direction, and relative steps of curvature, below this are rounding.
pub(crate) const SPLINE_BEND: f64 = 1e-6;
/// How much of the rounding of positions may come together in a derivative of a piece: second differences of the points of
/// a span of degree 9, 4·9·8.
pub(crate) const SPLINE_BEND_ROUNDING: f64 = 288.0;
/// Share of an axis' jerk that turning alone may use on a spline; see `limits::pieces`.
pub(crate) const SPLINE_TURNING_JERK_SHARE: f64 = 0.25;
/// Part of its time that a place of a spline may lose to limits in common with the stretch around it.
pub(crate) const LIMIT_GAIN: f64 = 0.06;
/// Part of its time that a stretch of a spline may lose by limits in common with its neighbours.
pub(crate) const LIMIT_SLOWDOWN: f64 = 0.1;
/// Most times that a polynomial piece of a spline is halved for its limits.
pub(crate) const LIMIT_HALVINGS: u32 = 5;
/// Most pieces with limits of their own of one element.
pub(crate) const MAX_LIMIT_PIECES: usize = 256;
/// Places examined on each polynomial piece of a spline to find where X turns: pieces are short enough to be nearly
/// circular.
pub(crate) const PLACES_PER_SPLINE_PIECE: usize = 8;

/// Most points left out of one line: bounds the work of a block and the state of a checkpoint.
pub(crate) const MAX_MERGED_POINTS: usize = 512;

/// Part of the tolerance `P` that merging may use: the rest is left to the curve of many blocks, which takes chords of an arc in less
/// time than the longer lines that more merging would make of them.
pub(crate) const MERGING_SHARE: f64 = 0.05;

/// Part of an element that may be cut off at one of its ends: something is left between two rounded corners.
pub(crate) const CORNER_SHARE: f64 = 0.45;

/// Cosine of the largest deflection that is rounded, 170°: beyond it the path turns back, and the curve would be as
/// tight as the corner.
pub(crate) const LEAST_CORNER_COSINE: f64 = -0.984_807_753_012_208;

/// Least length cut from an element, mm: shorter curves gain no time, and rounding would show in their curvature.
pub(crate) const LEAST_CORNER_CUT_MM: f64 = 1e-4;

/// Largest angle that an element turns in the length cut from it, rad, by its curvature at the corner: the curve is
/// then close to the one between lines.
pub(crate) const LARGEST_CORNER_TURN_RAD: f64 = 0.5;

/// What of the tolerance is left unused, mm: positions on splines and on the elements are exact to 1e-9 mm.
pub(crate) const UNUSED_TOLERANCE_MM: f64 = 2e-9;

/// Part of the tolerance used where deviations are sampled: the largest lies between two samples, each at most
/// 1/64 of the curve from it, where a deviation that changes over a tenth of the curve falls by less than 2 %.
pub(crate) const USED_SAMPLED_TOLERANCE: f64 = 0.97;

/// Samples of the deviation in each half of the curve.
pub(crate) const CORNER_HALF_SAMPLES: usize = 16;

/// What a stop in a corner has to gain to be preferred to rounding it, as the ratio of the times: a tool that stops may leave a mark, and
/// a plan is to be no slower than one that stops in every corner.
pub(crate) const CORNER_STOP_GAIN: f64 = 1.001;

/// The same in a curve of three axes most of whose blocks meet without a sharp corner: how fast it goes on behind what is held is less
/// certain there.
pub(crate) const FEW_STOPS_GAIN: f64 = 1.03;

/// Most blocks of one window of a curve, times its sharp corners, for which each of these is tried in every way.
pub(crate) const MOST_TRIED_BLOCKS: usize = 300;

/// Most elements of a curve that are tried in other ways in plans for the least time where fewer than half of its corners are sharp: in
/// longer ones these are tried one by one.
pub(crate) const MOST_TRIED_IN_LEAST_TIME: usize = 6;

/// Blocks on either side of a sharp corner among many blocks on which it is tried in plans for the least time: with 8 of them some are passed
/// 3 % slower, with 30 hardly any faster.
pub(crate) const CHORDS_TRIED: usize = 12;

/// Most elements of a curve of sharp corners that are tried together.
pub(crate) const MOST_TRIED_TOGETHER: usize = 24;

/// Largest sum of the directions of the two lines of a U-turn (6°).
pub(crate) const MOST_TURN_SKEW: f64 = 0.1;

/// Least part of the cut that its axes ask for with which a U-turn is tried: with less, the lines' axis nearly stops.
pub(crate) const LEAST_TURN_SHARE: f64 = 0.02;

/// Halvings in which the cut of a U-turn is found.
pub(crate) const TURN_STEPS: usize = 40;

/// Elements behind a corner, or behind a curve, that have to be known before ways to pass it are tried.
pub(crate) const WAYS_SEEN: usize = 5;

/// The same at a corner in no curve (2°), which may be passed slowly within a small tolerance.
pub(crate) const LEAST_ALONE_KINK: f64 = 0.03;

/// Ratio to the quickest time up to which a way, taken at all corners, is tried at single ones.
pub(crate) const MOST_MIXED: f64 = 1.3;

/// Pieces of the path before a trial that it starts with, at rest.
pub(crate) const TRAIL: usize = 4;
/// Largest memory that the curve of one of them takes, bytes: a long spline is slow to plan again and again. Sharp corners of five axes
/// have some tens of pieces.
pub(crate) const MOST_TRAIL_BYTES: usize = 65_536;

/// Interpolation period of the plans in which ways to pass corners are tried, s, whatever that of the job is: they are the same then.
pub(crate) const TRIED_PERIOD_S: f64 = 1e-3;

/// Least difference of the directions at a corner for which a stop is considered between short blocks (17°): less is passed faster at
/// any tolerance.
pub(crate) const LEAST_STOP_KINK: f64 = 0.3;

/// Difference of the directions from which on blocks that turn evenly are no chords of an arc, but have corners (40°).
pub(crate) const MOST_CHORD_KINK: f64 = 0.7;

/// Difference of the bends between three blocks, as a share of the larger one, within which neither of their corners stands out.
pub(crate) const LIKE_TURN_SHARE: f64 = 0.6;

/// Longest overlap of two blocks round their corner, as a share of the shorter time of them with stops, up to which plans for the least time try
/// a stop: what is saved is about the overlap, less what such a plan is above the optimum beside a slow corner.
pub(crate) const MOST_TRIED_OVERLAP: f64 = 0.2;

/// Lengths of lines for which that is examined, each a quarter of the one before, from two lengths of a stop on.
pub(crate) const STOP_LENGTHS: usize = 6;

/// Share of a corner's turn from which on another one is like it.
pub(crate) const LIKE_SHARE: f64 = 0.5;

/// Largest share of a corner's turn that the path may turn besides within its reach for the corner to stand alone.
pub(crate) const ALONE_SHARE: f64 = 0.25;

/// Difference of the bends between three blocks, as a share of the larger one, within which they are taken for chords of an arc: the
/// first and the last block of an arc in chords are often shorter.
pub(crate) const EVEN_TURN_SHARE: f64 = 0.3;

/// Largest difference of the velocities, by the path, with which a rotary axis turns along a block, as a share of their mean, for the block
/// to be part of a curve over many.
pub(crate) const MOST_UNEVEN_SHARE: f64 = 0.2;

/// Most tries for the cut between curves.
pub(crate) const MAX_CORNER_TRIES: usize = 12;

/// Elements after which a path is planned for the first time, so that its first setpoints do not wait for the whole
/// window: they come within milliseconds. In the first half of these, which is released, a path from rest has the
/// length to stop in the second half from whatever speed it has reached.
pub(crate) const FIRST_PLAN: usize = 1_000;
/// Elements after which a start is tried before [`FIRST_PLAN`], where elements are long: merged blocks.
pub(crate) const LEAST_START: usize = 32;
/// Time of what such a start releases at the least, s.
pub(crate) const START_S: f64 = 1.0;
/// The same where the path is planned again after a change of the feed override: of less the rest would soon have to be planned.
pub(crate) const RESTART_S: f64 = 0.3;
/// Length of a run that may go on, in lengths of its stop, from which what is slower is not joined to it but divided from it: twice
/// the one from which a run with the same acceleration is.
pub(crate) const LONG_STOPS: f64 = 4.0;
/// What such a start leaves of a run that may go on, in lengths of its stop, which may become longer.
pub(crate) const OPEN_STOPS: f64 = 2.0;

/// Memory that a window takes at the most before a part of it is released, bytes: 100 000 straight blocks, or fewer of splines.
pub(crate) const WINDOW_BYTES: usize = 128 << 20;
/// Bounds of what is kept in memory, bytes, the same on every platform, so that plans are: an element with its request, each
/// stretch of it while it is planned, what a spline or five axes need besides, a piece of a spline (X, Y and Z of degree 9), and
/// one power of a five-axis piece. Lists may have grown to twice what they hold.
pub(crate) const ELEMENT_BYTES: usize = 640;
/// See [`ELEMENT_BYTES`].
pub(crate) const STRETCH_BYTES: usize = 640;
/// See [`ELEMENT_BYTES`].
pub(crate) const CURVE_BYTES: usize = 1_024;
/// See [`ELEMENT_BYTES`].
pub(crate) const SPLINE_PIECE_BYTES: usize = 2 * 264;
/// See [`ELEMENT_BYTES`].
pub(crate) const FIVE_AXIS_PIECE_BYTES: usize = 2 * 40;
/// See [`ELEMENT_BYTES`].
pub(crate) const FIVE_AXIS_POWER_BYTES: usize = 2 * 40;

/// Directions closer to the first rotary axis than this are taken along it, rad: no tool shows 0.02″, and the first axis need
/// not turn half a turn within nanometres for them. The tool centre point is exact all the same.
pub(crate) const POLE_RAD: f64 = 1e-7;
/// Directions closer to each other than this are the same, rad: rounding of a unit vector is a thousandth of it.
pub(crate) const SAME_DIRECTION_RAD: f64 = 1e-12;
/// Rotary axes and tool that miss the first axis' line by no more than this meet it: rounding of three unit vectors.
pub(crate) const REACHED_POLE: f64 = 1e-12;
/// Largest tolerance within which a pole may be passed through, rad (5.7°).
pub(crate) const MAX_POLE_TOLERANCE_RAD: f64 = 0.1;
/// Largest error of the polynomials of a linear axis under five-axis motion, mm, beside rounding.
pub(crate) const FIVE_AXIS_FIT_MM: f64 = 1e-10;
/// Largest error of the polynomials of a rotary axis, rad: it does not move the tool centre point, which the linear axes
/// follow, but would show as a step where elements meet.
pub(crate) const FIVE_AXIS_FIT_RAD: f64 = 2e-12;
/// Largest ratio of the last term of a fit to its largest error: the terms fall by more from one to the next but one.
pub(crate) const FIVE_AXIS_TAIL: f64 = 1e4;
/// Most times that a five-axis element is halved for its polynomials.
pub(crate) const MAX_FIVE_AXIS_HALVINGS: u32 = 40;
/// Most polynomial pieces of a five-axis element.
pub(crate) const MAX_FIVE_AXIS_PIECES: usize = 4_096;
/// Largest difference between where the rotary axes are and where a block starts, rad: rounding of a unit vector is as
/// much where it is taken along a pole no more.
pub(crate) const SAME_START_RAD: f64 = 1e-8;
/// Largest difference between where the linear axes are and where a block starts, mm.
pub(crate) const SAME_START_MM: f64 = 1e-5;
/// Coefficients of a five-axis element's polynomials below this are left out, mm and degrees.
pub(crate) const FIVE_AXIS_NOTHING: f64 = 1e-15;

/// First scale of the fit of a curve as a share of the reach at a place: a corner is then left by 0.87 of the tolerance.
pub(crate) const CURVE_SCALE_SHARE: f64 = 0.65;
/// Distance of a curve's knots as a share of the reach: half of the scale, so that the knots hardly bind the curve.
pub(crate) const CURVE_KNOT_SHARE: f64 = 0.33;
/// Longest reach, mm: beyond it a curve is passed at any speed that a machine has.
pub(crate) const CURVE_MOST_REACH_MM: f64 = 6.0;
/// Most turns that the reach at a place is taken from.
pub(crate) const CURVE_TURNS_SEEN: usize = 256;
/// Parts of an arc whose turns are counted each, rad.
pub(crate) const CURVE_ARC_STEP_RAD: f64 = 0.05;
/// Least spans of a curve: three coefficients are given at each end, and some have to be free.
pub(crate) const CURVE_LEAST_SPANS: usize = 8;
/// Part of the tolerance that a curve may use where a window starts, and where it ends: what is fitted again in the next
/// window, then farther ahead, has room for what differs.
pub(crate) const CURVE_FIRST_SHARE: f64 = 0.98;
/// See [`CURVE_FIRST_SHARE`].
pub(crate) const CURVE_LAST_SHARE: f64 = 0.88;
/// Most rounds of the fit.
pub(crate) const CURVE_ROUNDS: usize = 24;
/// Largest change of the fit's scale along the path: a fit knows little of what is some scales away.
pub(crate) const CURVE_SCALE_GRADE: f64 = 0.3;
/// Most knots of a window.
pub(crate) const CURVE_KNOTS: usize = 64;
/// Part of a window's knots that is settled by its fit; the rest is what the settled part has to know.
pub(crate) const CURVE_SETTLED_SHARE: f64 = 0.7;
/// Most blocks of a window.
pub(crate) const CURVE_BLOCKS: usize = 512;
/// Largest part of what two neighbouring corners ask of an element that it may fall short of without being part of one curve
/// over both.
pub(crate) const CURVE_LINK_SHARE: f64 = 0.8;
/// The same between tangent elements in plans of runs: an arc between ramps of curvature has higher limits than a curve in place of all
/// three, which gains only where the ramps would hardly have room.
pub(crate) const CURVE_RAMP_LINK_SHARE: f64 = 0.3;
/// Longest reach of a corner into an element, mm; see [`CURVE_MOST_REACH_MM`].
pub(crate) const CURVE_MOST_END_MM: f64 = 10.0;
/// Deviation of the curve through a step of curvature Δκ that reaches d to both sides, as a share of Δκ·d².
pub(crate) const RAMP_DEVIATION: f64 = 0.0107;
/// Steps of direction and of curvature, 1/mm, below this need no ramp.
pub(crate) const LEAST_RAMP: f64 = 1e-5;
/// Largest angle that an element turns in the length cut from it for a ramp of curvature, rad.
pub(crate) const LARGEST_RAMP_TURN_RAD: f64 = 0.8;
/// Longest reach of a corner into a bent element as a multiple of √(tolerance/curvature): a ramp from straight takes ten.
pub(crate) const CURVE_MOST_END_REACH: f64 = 12.0;
/// Least part of the tolerance that merging has to leave for a corner.
pub(crate) const LEAST_CURVE_SHARE: f64 = 0.1;
/// Least tolerance, mm, within which many blocks become one curve: with less, its knots would be nearer than positions are
/// rounded.
pub(crate) const LEAST_CURVE_TOLERANCE_MM: f64 = 1e-5;
/// Part of a knot's distance to the one before within which it is moved to the end of an element.
pub(crate) const CURVE_SNAP_SHARE: f64 = 0.05;

/// Share of the limits of the axes that a speed is planned with: what it exceeds them by between the places at which they are
/// held, and the steps of direction that rounding leaves where elements meet, stay within the rest.
pub(crate) const SPEED_LIMIT_SHARE: f64 = 0.995;
/// Largest share of a limit that may be found between those places: the rest is for the steps where elements meet.
pub(crate) const SPEED_CHECKED_SHARE: f64 = 0.9985;
/// The share that is permitted at a place where it was exceeded: less than what is found to be too much.
pub(crate) const SPEED_HELD_SHARE: f64 = 0.998;
/// Shortest and longest interval between knots of the speed, s. The time grows by a percent where an interval is not much
/// shorter than the acceleration takes to change; every interval costs a microsecond or two.
pub(crate) const SPEED_INTERVALS: [f64; 2] = [1e-3, 2e-3];
/// Longest ramp of constant jerk from rest, in intervals.
pub(crate) const SPEED_RAMP_INTERVALS: f64 = 2.0;
/// Largest share of a window that a ramp from rest takes.
pub(crate) const SPEED_RAMP_SHARE: f64 = 0.002;
/// Most steps of the interior point method; it takes some twelve.
pub(crate) const SPEED_STEPS: usize = 40;
/// Duality gap at which a speed is good, as a share of the time.
pub(crate) const SPEED_GAP: f64 = 1e-3;
/// Least slack of a limit to start with, as a share of it.
pub(crate) const SPEED_START_SLACK: f64 = 0.3;
/// How often limits are lowered where they are exceeded between the knots.
pub(crate) const SPEED_TIGHTENINGS: usize = 6;
/// Intervals to either side of an exceeded limit that are solved again, at first.
pub(crate) const SPEED_AROUND: usize = 20;
/// Derivatives at the end of an interval are taken this share of it inside: those of the element that it belongs to.
pub(crate) const SPEED_SIDE: f64 = 1e-7;

/// Largest share of acceleration and jerk that a junction may take, by its plan of runs, without dividing a row that is planned
/// for the least time.
pub(crate) const SMOOTH_RESERVE: f64 = 0.03;
/// A share this small is within what a plan for the least time leaves unused.
pub(crate) const NO_RESERVE: f64 = 4e-4;
/// Longest change of speed that is planned anew for the least time, s: in a longer one the feed is nearly steady.
pub(crate) const MOST_RUN_S: f64 = 4.0;
/// Time of a window that is planned for the least time at once, by the plan of runs, s.
pub(crate) const WINDOW_S: f64 = 1.5;
/// The same of the first window, so that the first setpoints come soon; each of the next ones is at most twice as long, s.
pub(crate) const FIRST_WINDOW_S: f64 = 0.3;
/// A cruise at the commanded speed from this long on is left out of what is planned for the least time, s.
pub(crate) const LONG_CRUISE_S: f64 = 0.1;
/// Relative difference within which a speed is the commanded one.
pub(crate) const AT_COMMAND: f64 = 1e-9;
/// Part of a window's time, from and to, in which the next one takes over at the earliest.
pub(crate) const HANDOVER: [f64; 2] = [0.55, 0.75];
/// Time before a window's end from which on its speed may depend on how it ends, in times of a stop at the most: from and to where the
/// next one takes over, in windows that are long enough.
pub(crate) const HANDOVER_STOPS: [f64; 2] = [2.5, 1.5];
/// A window that takes no more than this times as long as at its commanded speeds gains nothing.
pub(crate) const WORTHWHILE: f64 = 1.0005;
/// Time on either side of a junction in which differences of setpoints average over it, s: three periods of 4 ms. At a longer
/// period a step is spread so far that its share is small.
pub(crate) const RESERVED_S: f64 = 0.012;
/// Shares of the limits, tried in order, at which the path brakes as if it were straight when a lower feed is commanded.
pub(crate) const DIRECT_SHARES: [f64; 8] = [0.995, 0.97, 0.94, 0.9, 0.85, 0.8, 0.7, 0.6];
/// The same where the braking begins later, after steps of this time, s, and the most of them.
pub(crate) const LATER_SHARES: [f64; 4] = [0.97, 0.8, 0.6, 0.35];
pub(crate) const LATER_STEP_S: f64 = 1e-3;
/// Steps that are tried beyond one from which the path can brake.
pub(crate) const HARDER_STEPS: usize = 30;
pub(crate) const LATER_STEPS: usize = 200;
/// Share of the jerk from which on an acceleration ends at a commanded speed without room for anything else, and the same where no other
/// way was found.
pub(crate) const NEARLY_ALL: f64 = 0.85;
pub(crate) const LEAST_OF_ALL: f64 = 0.2;
/// Shares of a commanded speed to which the path then comes down, in the order in which they are tried.
pub(crate) const LOWER_SPEEDS: [f64; 3] = [1.0, 0.7, 0.4];
/// Time for which a path may have to go on in a corner before it can brake, s, the steps in which it is examined, s, and the share of the
/// limits with which it then brakes.
pub(crate) const PASSING_S: f64 = 0.06;
pub(crate) const PASSING_STEP_S: f64 = 0.01;
pub(crate) const PASSING_SHARE: f64 = 0.6;
/// Shares of the limits at which the path brakes when a lower feed is commanded, tried in order.
pub(crate) const BRAKING_SHARES: [f64; 3] = [0.7, 0.4, 0.2];
/// Share of the limits with which a change of the feed has to be carried out at the latest: the course is planned anew as far as a
/// stop takes with it.
pub(crate) const REACHING_SHARE: f64 = 0.4;
/// Time of the course that is planned anew at a change of the feed at the least, s.
pub(crate) const CHANGE_S: f64 = 0.05;
/// Factor between the speed of such a braking and the highest that is planned instead of it: a plan needs room.
pub(crate) const CEILING_MARGIN: f64 = 1.02;
/// Factor between the length of such a braking to rest and the one that is planned.
pub(crate) const REST_MARGIN: f64 = 1.05;
/// Speed below which the path rests, mm/s: what rounding leaves of a speed where a profile ends.
pub(crate) const AT_REST: f64 = 1e-9;
/// What a window leaves of the limits of acceleration and jerk at its end, where another one takes over: with other knots beyond,
/// it has to find a way from a state at those limits.
pub(crate) const SPEED_GRADE: f64 = 6e-3;
/// Part of what a window found beyond the next one's start in which that keeps its knots.
pub(crate) const KEPT_KNOTS: f64 = 0.6;
/// What is tried where no way was found on from a window: its time as a share of what it would be, and [`KEPT_KNOTS`].
pub(crate) const OTHER_WINDOWS: [[f64; 2]; 2] = [[0.5, KEPT_KNOTS], [1.0, 0.9]];
/// Time of what is left of a window, s, down to which a way on is tried from farther on it; what is left is braking then.
pub(crate) const LEAST_FOUND_S: f64 = 0.1;

/// Steps per mm of the grid on which trials of ways past corners are stated: finer than 1e-9 mm, and a power of two, so that its places
/// are exact numbers.
const GRID_PER_MM: f64 = (1_u64 << 30) as f64;

/// The nearest place of the grid, mm; never −0.
pub(crate) fn on_grid(value_mm: f64) -> f64 {
    (value_mm * GRID_PER_MM).round() / GRID_PER_MM + 0.0
}

/// Trials of ways past corners that are remembered, with less than 1 MB: a raster comes to four in plans for the least time, and to about
/// ten in fast ones.
pub(crate) const MOST_ANSWERS: usize = 16;

/// Most pieces of a spline before a trial with which it is remembered.
pub(crate) const MOST_ASKED_PIECES: usize = 16;

/// Most elements of a trial that is remembered.
pub(crate) const MOST_ASKED_ELEMENTS: usize = 48;

/// Shortest piece of a spline before a trial that is remembered, mm: on the grid its direction is then off by less than 1e-4.
pub(crate) const LEAST_ASKED_PIECE_MM: f64 = 1e-4;
