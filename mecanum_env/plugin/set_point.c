// From the command that is sent to the input of the wheel law; chain.h says where it stands in the drive.

#include "set_point.h"

#include <math.h>

#define ABSURD 1e10     // commands [rpm] and voltages [V] beyond this count as 0
#define S_CURVE_LEGS 3  // of an S-curve in a part of a tick: up to 0, back through 0, and on to the command

// Index of command j in the ring; j may be negative (before the start) or, in a state written by hand, anything.
static int slot(double j) {
  return fabs(j) < 1e15 ? (int)((int64_t)j & (RING - 1)) : 0;
}

double set_point_sane(double given) { return fabs(given) <= ABSURD ? given : 0; }

// A command u [rpm] after the static map through the knots x with values y: linear in between, with the offset of the
// outermost knot beyond it. Without a knot below 0 it is mirrored and passes through 0.
static double mapped(const double* p, double u) {
  const double *x = p + KNOT_1, *y = p + VALUE_1;
  int n = (int)fmin(p[MAP_SIZE], MAP_KNOTS), mirrored = x[0] >= 0, above = 0;
  double v = mirrored ? fabs(u) : u;
  while (above < n && x[above] < v) above++;  // the first knot that is not below v
  double x0 = 0, y0 = 0;
  if (above > 0) x0 = x[above - 1], y0 = y[above - 1];
  else if (!mirrored) x0 = x[0], y0 = y[0];
  double width = above < n ? x[above] - x0 : 0;
  double out = width > 0 ? y0 + (y[above] - y0) * ((v - x0) / width) : y0 + (v - x0);
  return mirrored ? copysign(out, u) : out;
}

// A command [rpm] with what a custom effect of a station adds to it, at a time [s] since the clocks started.
static double with_custom(const Drive* s, const double* p, int station, double u, const Substep* now, double seconds) {
  const double* program = PROGRAM(p, station);
  if (program[0] == OP_END) return u;
  Inputs inputs = {u, now->speed / RAD_S_PER_RPM, s->angle, seconds, now->lost_v};
  return set_point_sane(u + program_value(program, &inputs));
}

// The drive's command [rpm] for a latched command u [rpm] that acts at a time [s] since the clocks started.
static double shaped(const Drive* s, const double* p, double u, const Substep* now, double seconds) {
  double limit = p[SATURATION], knee = fmin(p[SOFTNESS], limit);
  u = with_custom(s, p, AT_COMMAND, u, now, seconds);
  if (fabs(u) < p[DEADBAND]) u = 0;
  if (p[SUBTRACTED] > 0) u = fabs(u) > p[SUBTRACTED] ? u - copysign(p[SUBTRACTED], u) : 0;
  if (p[GAIN] > 0) u *= p[GAIN];
  if (p[REVERSE_RATIO] > 0 && u < 0) u *= p[REVERSE_RATIO];
  if (p[DROP] > 0) u *= fmax(0, 1 - p[DROP] * seconds);
  if (p[GAIN_PER_VOLT] > 0) u *= fmax(0, 1 - p[GAIN_PER_VOLT] * now->lost_v);
  if (p[WARM_UP_TIME] > 0 && p[WARM_UP] != 0) u *= 1 - p[WARM_UP] * (1 - exp(-seconds / p[WARM_UP_TIME]));
  if (p[MAP_SIZE] >= 1) u = mapped(p, u);
  u = with_custom(s, p, AT_SET_POINT, u, now, seconds);
  if (limit > 0 && knee > 0) {
    double beyond = fabs(u) - (limit - knee);
    // The soft knee is a parabola that leaves the line with slope 1 and reaches the limit with slope 0.
    if (beyond > 0 && beyond < 2 * knee) u = copysign(limit - knee + beyond - beyond * beyond / (4 * knee), u);
  }
  if (limit > 0) u = fmin(fmax(u, -limit), limit);
  return u;
}

// The hash splitmix64 of 64 bits.
static uint64_t mixed(uint64_t bits) {
  bits = (bits ^ (bits >> 30)) * 0xBF58476D1CE4E5B9u;
  bits = (bits ^ (bits >> 27)) * 0x94D049BB133111EBu;
  return bits ^ (bits >> 31);
}

enum { JITTER_STREAM, LOSS_STREAM };

// A random number from 0 to below 1 for a latch, from the link's seed.
static double uniform(const double* p, double latch, int stream) {
  const uint64_t step = 0x9E3779B97F4A7C15u;
  const double most = 9007199254740992.0;  // 2^53, up to which whole numbers are exact
  uint64_t seed = (uint64_t)fmin(fmax(p[SEED], 0), most), number = (uint64_t)fmin(fmax(latch, 0), most);
  return (double)(mixed(mixed(seed + step) + (2 * number + stream + 1) * step) >> 11) * 0x1p-53;
}

// Latch a command u [rpm] that is not lost. If the delay jitters, each change of the command has its own, but arrives
// neither before it is sent nor before an earlier one; a repetition arrives with the change that it repeats.
static void receive(Drive* s, const double* p, double u, const Substep* now) {
  double sent_at = s->latches * p[COMMAND_PERIOD], acts_at = sent_at + p[DELAY];
  int here = slot(s->latches);
  if (p[JITTER] > 0) {
    double arrival = s->arrival[slot(s->latches - 1)];
    double deviation = SPREAD * (2 * uniform(p, s->latches, JITTER_STREAM) - 1);
    if (u != s->sent) arrival = fmax(arrival, sent_at + fmax(p[DELAY] + p[JITTER] * deviation, 0));
    s->arrival[here] = arrival;
    acts_at = fmax(sent_at, arrival);
  }
  s->sent = u;
  s->command[here] = shaped(s, p, u, now, acts_at);
}

void set_point_latch(Drive* s, const double* p, const Substep* now) {
  int here = slot(s->latches), last = slot(s->latches - 1);
  if (p[LOSS] > 0 && uniform(p, s->latches, LOSS_STREAM) < p[LOSS]) {
    s->command[here] = s->command[last], s->arrival[here] = s->arrival[last];
  } else {
    double u = set_point_sane(now->command);
    if (p[QUANTUM] > 0) u = rint(u / p[QUANTUM]) * p[QUANTUM];
    receive(s, p, u, now);
  }
  s->latches += 1;
}

void set_point_restart(Drive* s) {
  double last = s->command[slot(s->latches - 1)];
  for (int i = 0; i < RING; i++) s->command[i] = last, s->arrival[i] = 0;
  s->ticks = s->latches = 0;
}

// Move a ramp straight to a point at a rate [rpm per tick] for at most the part of a tick left; return the area.
static double leg(double* ramp, double to, double rate, double* left) {
  double before = *ramp, way = to - before, time = fabs(way) / rate, spent = fmin(*left, time);
  *ramp = time <= *left ? to : before + copysign(rate * spent, way);
  *left -= spent;
  return spent * (before + *ramp) / 2;
}

// Move a ramp at one rate [rpm per tick] towards 0 and at another away from it.
static double two_rates(double* ramp, double command, double part, double rise, double brake) {
  double nearer = fmin(fmax(command, fmin(*ramp, 0)), fmax(*ramp, 0)), left = part;
  double area = leg(ramp, nearer, brake, &left);
  if (*ramp == nearer) area += leg(ramp, command, rise, &left);
  return area + left * *ramp;
}

// The first time at which a value with a slope and its change passes through 0, or touches it; infinite for none.
static double passes(double value, double slope, double change) {
  double square = slope * slope - 2 * change * value;
  if (value == 0 || square < 0) return INFINITY;
  double twice = -(slope + copysign(sqrt(square), slope)), first = INFINITY;
  if (twice != 0 && 2 * value / twice > 0) first = 2 * value / twice;
  if (change != 0 && twice / change > 0) first = fmin(first, twice / change);
  return first;
}

// Move the ramp with bounded jerk [rpm/s2] to a point at which its slope is 0, in the shortest time, for at most the
// seconds left; return the area. The slope goes to a peak, stays there, and falls to 0. If its two rates differ, the ramp
// stops where it passes through 0, with the slope that it has there: from then on the other rate counts.
static double glide(Drive* s, double to, double rise, double brake, double jerk, double* left) {
  double value = s->ramp, slope = s->slope, area = 0;
  // Whether to push up or down: from where it would come to rest if the slope fell to 0 from now on.
  double push = value + slope * fabs(slope) / (2 * jerk) < to ? 1 : -1;
  double most = push * value < 0 ? brake : rise, way = push * (to - value), begin = push * slope;
  double peak = fmin(sqrt(fmax(jerk * way + begin * begin / 2, 0)), most);
  // Behind 0 the slope may be steeper than the rate there.
  double bend = peak < begin ? begin * begin : 2 * peak * peak - begin * begin, turn = peak < begin ? -push : push;
  double cruise = peak > 0 ? fmax((way - bend / (2 * jerk)) / peak, 0) : 0;
  double change[] = {turn * jerk, 0, -push * jerk}, time[] = {fabs(peak - begin) / jerk, cruise, peak / jerk};
  int arrives = 1, crosses = 0;
  for (int i = 0; i < 3 && !crosses; i++) {
    double spent = fmin(*left, time[i]), zero = brake != rise ? passes(value, slope, change[i]) : INFINITY;
    crosses = zero < spent;
    if (crosses) spent = zero;
    arrives &= spent == time[i];
    area += spent * (value + spent * (slope / 2 + change[i] * spent / 6));
    value += slope * spent + change[i] * spent * spent / 2;
    slope += change[i] * spent;
    *left -= spent;
    if (crosses) value = 0;
  }
  s->ramp = arrives ? to : value;
  s->slope = arrives ? 0 : slope;
  return area;
}

// Move the S-curve to a command.
static double s_curve(Drive* s, double command, double part, double rise, double brake, double jerk, double tau) {
  double left = part * tau, area = 0;
  for (int i = 0; i < S_CURVE_LEGS; i++) area += glide(s, command, rise, brake, jerk, &left);
  return (area + left * s->ramp) / tau;
}

// Move the ramp towards a command for a part of a tick; return the part's contribution to the mean over the tick.
static double ramped(Drive* s, const double* p, double command, double part) {
  double tau = p[SAMPLE_PERIOD], rise = p[ACCELERATION] > 0 ? p[ACCELERATION] : INFINITY;
  double brake = p[BRAKE] > 0 ? p[BRAKE] : rise;
  if (p[JERK] > 0) return s_curve(s, command, part, rise, brake, p[JERK], tau);
  if (brake != rise) return two_rates(&s->ramp, command, part, rise * tau, brake * tau);
  if (isinf(rise)) return s->ramp = command, part * command;
  double limit = rise * tau, before = s->ramp;
  s->ramp = fmin(fmax(command, before - limit * part), before + limit * part);
  double moved = s->ramp - before;
  return part * s->ramp - moved * fabs(moved) / (2 * limit);
}

// When latched command j arrives [s].
static double arrival_of(const Drive* s, const double* p, double j) {
  return p[JITTER] > 0 ? s->arrival[slot(j)] : j * p[COMMAND_PERIOD] + p[DELAY];
}

// The number of the newest of the commands up to `latest` that have arrived by a time t [s].
static double newest(const Drive* s, const double* p, double latest, double t) {
  double T = p[COMMAND_PERIOD], oldest = latest - (RING - 1), j = latest;
  if (p[JITTER] > 0)
    while (j > oldest && !(s->arrival[slot(j)] <= t + EPS * T)) j--;
  else j = floor((t - p[DELAY]) / T + EPS);
  return !(j <= latest) ? latest : j < oldest ? oldest : j;
}

double set_point_input(Drive* s, const double* p) {
  double tau = p[SAMPLE_PERIOD];
  double t = s->ticks * tau;
  double latest = floor(t / p[COMMAND_PERIOD] + EPS);
  if (!(latest <= s->latches - 1)) latest = s->latches - 1;
  double j = newest(s, p, latest, t), sum = 0, done = 0;
  for (int i = 1; i < RING && j + 1 <= latest; i++, j++) {
    double arrival = arrival_of(s, p, j + 1);
    if (!(arrival < t + tau)) break;
    double part = (arrival - t) / tau;
    sum += ramped(s, p, s->command[slot(j)], part - done);
    done = part;
  }
  return sum + ramped(s, p, s->command[slot(j)], 1 - done);
}
