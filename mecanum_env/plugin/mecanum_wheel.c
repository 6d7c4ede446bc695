// Actuator plugin "mecanum.wheel": one identified wheel drive, command [rpm] in, torque [N m] out.
//
// Each substep n at time n*h: latch and shape the command when due, tick the wheel law when due, ramp the setpoint
// linearly from w(k) to w(k+1), and hold it with a (PI) velocity servo:
//
//   w(k+1) = A w(k) + B w(k-1) + C w(k-2) + D r(k) + E r(k-1) + F r(k-2)          [rpm]
//   torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]
//
// limited to torque_limit_n_m. The law is what the drive does with the free wheel; J, the wheel's own inertia, is
// fed forward, so the free wheel does just that. Friction of the wheel's bearing acts beside this torque.
//
// mecanum_env/law/drive.py is the same law in Python; the tests hold the two equal bit for bit.
//
// All parameters are numeric fields of the actuator, read anew at each call: nothing is cached, so copies,
// pickles, batches of different models and edits of a compiled model all do what they say. All memory is in
// plugin_state (mecanum_env/plugin/layout.py names the entries), written in reset and advance only.

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <mujoco/mujoco.h>

#define PLUGIN_NAME "mecanum.wheel"
#define RING 32                  // latched commands remembered: bounds the delay
#define MAX_EVENTS 1024          // law ticks or latches in one substep
#define EPS 1e-9                 // of a period: a clock may be this early
#define LEARNT 0.1               // of a change of the load, in a substep
static const double RAD_S_PER_RPM = 2.0 * 3.141592653589793 / 60.0;

enum { SAMPLE_PERIOD = 6, COMMAND_PERIOD, QUANTUM, SATURATION };  // in dynprm, after A..F
enum { INTEGRAL_GAIN, DELAY, TORQUE_LIMIT, NUSER };               // in user; those that follow may be absent
enum { DEADBAND = NUSER, GAIN, REVERSE_RATIO, DROP, SOFTNESS, ACCELERATION, GAP, BREAKAWAY, STRIBECK,
       COULOMB, INERTIA, LAST_USER };

typedef struct {
  double substeps, ticks, latches;                 // since the clocks started
  double timestep, sample_period, command_period;  // the clocks in use; another value restarts them
  double w0, w1, w2, r1, r2;                       // the law's memory [rpm]: w0 = w(k+1), w1 = w(k)
  double ramp;                                     // command behind the acceleration limit, when the tick ends [rpm]
  double setpoint;                                 // at the end of the last substep [rad/s]
  double rise;                                     // of the setpoint over the last substep [rad/s]
  double integral;                                 // of setpoint - speed of the motor [rad]
  double change;                                   // of the speed over the last substep [rad/s]
  double gap;                                      // motor ahead of wheel in the backlash, +- half of it [rad]
  double load;                                     // torque of others on the wheel, smoothed [N m]
  double command[RING];                            // latched command j at j modulo RING [rpm]
} Drive;

_Static_assert(sizeof(mjtNum) == sizeof(double), "the plugin needs MuJoCo in double precision");
enum { NSTATE = sizeof(Drive) / sizeof(double) };

// Where command j is kept; j may be negative (before the start) or, in a state written by hand, anything.
static int slot(double j) {
  double s = fmod(j, RING);
  if (s < 0) s += RING;
  return s >= 0 && s < RING ? (int)s : 0;
}

// A number that the model may leave out: 0, which is "off" for all of them.
static double option(const mjModel* m, int id, int i) {
  return i < m->nuser_actuator ? m->actuator_user[id * m->nuser_actuator + i] : 0;
}

// What the drive makes of a received command that acts at a time since the start of the clocks.
static double shaped(const mjModel* m, int id, double u, double seconds) {
  double gain = option(m, id, GAIN), ratio = option(m, id, REVERSE_RATIO), drop = option(m, id, DROP);
  double limit = m->actuator_dynprm[id * mjNDYN + SATURATION], knee = fmin(option(m, id, SOFTNESS), limit);
  if (fabs(u) < option(m, id, DEADBAND)) u = 0;
  if (gain > 0) u *= gain;
  if (ratio > 0 && u < 0) u *= ratio;
  if (drop > 0) u *= fmax(0, 1 - drop * seconds);
  if (limit > 0 && knee > 0) {
    double beyond = fabs(u) - (limit - knee);
    // A parabola that leaves the line with slope 1 and reaches the limit with slope 0.
    if (beyond > 0 && beyond < 2 * knee) u = copysign(limit - knee + beyond - beyond * beyond / (4 * knee), u);
  }
  if (limit > 0) u = fmin(fmax(u, -limit), limit);
  return u;
}

// What the robot latches: NaN and absurd values are 0, as for MuJoCo's own actuators.
static double latch(const mjModel* m, const mjData* d, int id, double seconds) {
  const mjtNum* p = m->actuator_dynprm + id * mjNDYN;
  int adr = m->actuator_ctrladr[id];
  double u = d->ctrl[adr];
  if (!(fabs(u) <= mjMAXVAL)) u = 0;
  if (m->actuator_ctrllimited[adr] && !(m->opt.disableflags & mjDSBL_CLAMPCTRL))
    u = mju_clip(u, m->actuator_ctrlrange[2 * adr], m->actuator_ctrlrange[2 * adr + 1]);
  if (p[QUANTUM] > 0) u = rint(u / p[QUANTUM]) * p[QUANTUM];
  return shaped(m, id, u, seconds);
}

// Move the ramp towards a command for a part of a tick; return its share in the mean over the tick. The ramp
// rises by at most `most` in a whole tick; 0: at once.
static double ramped(double* ramp, double command, double part, double most) {
  if (!(most > 0)) return *ramp = command, part * command;
  double before = *ramp;
  *ramp = fmin(fmax(command, before - most * part), before + most * part);
  double way = *ramp - before;
  return part * *ramp - way * fabs(way) / (2 * most);
}

// r(k): the mean over the tick of the delayed command, as far as it was sent by the tick's start, behind the
// acceleration limit.
static double law_input(Drive* s, double tau, double T, double delay, double most) {
  double t = s->ticks * tau;
  double latest = floor(t / T + EPS);
  if (!(latest <= s->latches - 1)) latest = s->latches - 1;
  double j = floor((t - delay) / T + EPS);
  if (!(j <= latest)) j = latest;
  if (j < latest - (RING - 1)) j = latest - (RING - 1);
  double sum = 0, done = 0;
  for (int i = 1; i < RING && j + 1 <= latest; i++, j++) {
    double arrival = (j + 1) * T + delay;
    if (!(arrival < t + tau)) break;
    double part = (arrival - t) / tau;
    sum += ramped(&s->ramp, s->command[slot(j)], part - done, most);
    done = part;
  }
  return sum + ramped(&s->ramp, s->command[slot(j)], 1 - done, most);
}

// The drive at the end of this substep; its integral is still that of the start.
static Drive after_substep(const mjModel* m, const mjData* d, int id, const mjtNum* state) {
  const mjtNum* p = m->actuator_dynprm + id * mjNDYN;
  const double h = m->opt.timestep, tau = p[SAMPLE_PERIOD], T = p[COMMAND_PERIOD];
  const double delay = m->actuator_user[id * m->nuser_actuator + DELAY];
  const double most = option(m, id, ACCELERATION) * tau;  // change of the ramp per tick
  Drive s;
  memcpy(&s, state, sizeof s);

  if (s.timestep != h || s.sample_period != tau || s.command_period != T) {
    double last = s.command[slot(s.latches - 1)];
    for (int i = 0; i < RING; i++) s.command[i] = last;
    s.substeps = s.ticks = s.latches = 0;
    s.timestep = h, s.sample_period = tau, s.command_period = T;
    s.change = 0;  // it belongs to a substep of the old length
  }
  double now = s.substeps * h;
  for (int i = 0; i < MAX_EVENTS && now >= s.latches * T - EPS * T; i++) {
    s.command[slot(s.latches)] = latch(m, d, id, s.latches * T + delay);
    s.latches += 1;
  }
  for (int i = 0; i < MAX_EVENTS && now >= s.ticks * tau - EPS * tau; i++) {
    double r = law_input(&s, tau, T, delay, most);
    double w = p[0] * s.w0 + p[1] * s.w1 + p[2] * s.w2 + p[3] * r + p[4] * s.r1 + p[5] * s.r2;
    s.w2 = s.w1, s.w1 = s.w0, s.w0 = w;
    s.r2 = s.r1, s.r1 = r;
    s.ticks += 1;
  }
  s.substeps += 1;
  double part = (s.substeps * h - (s.ticks - 1) * tau) / tau;
  part = part < 0 ? 0 : part > 1 ? 1 : part;
  double before = s.setpoint;
  s.setpoint = (s.w1 + (s.w0 - s.w1) * part) * RAD_S_PER_RPM;
  s.rise = s.setpoint - before;
  return s;
}

static double stiffness(const mjModel* m, int id) { return -m->actuator_biasprm[id * mjNBIAS + 2]; }

static double speed(const mjModel* m, const mjData* d, int id) { return d->actuator_velocity[m->actuator_outadr[id]]; }

// Whether the integrator takes kv times the coming change of speed off the torque.
static int implicit(const mjModel* m) {
  return m->opt.integrator == mjINT_IMPLICIT || m->opt.integrator == mjINT_IMPLICITFAST;
}

// The inertia that a substep moves, by the reported torque: the wheel's own and that damping.
static double moved(const mjModel* m, int id) {
  return option(m, id, INERTIA) + (implicit(m) ? m->opt.timestep * stiffness(m, id) : 0);
}

// The speed of the motor without load: that at which the servo's torque is 0.
static double unloaded(const mjModel* m, int id, const Drive* s) {
  double ki = m->actuator_user[id * m->nuser_actuator + INTEGRAL_GAIN];
  return s->setpoint + ki / stiffness(m, id) * s->integral;
}

// The torque with which the wheel gets none, if it changes its speed as it did: the integrator takes it off.
static double damping(const mjModel* m, int id, const Drive* s) {
  return implicit(m) ? stiffness(m, id) * s->change : 0;
}

// The torque to report without its limit.
static double asked_torque(const mjModel* m, const mjData* d, int id, const Drive* s) {
  double h = m->opt.timestep, kv = stiffness(m, id), half = option(m, id, GAP) / 2;
  double rate = unloaded(m, id, s) + option(m, id, INERTIA) * s->rise / (h * kv) - speed(m, d, id);
  if (!(half > 0)) return kv * rate;
  // Only what of the motor's way in this substep lies beyond the gap moves the wheel.
  double ahead = s->gap + h * rate, beyond = ahead - mju_clip(ahead, -half, half);
  return beyond == 0 ? damping(m, id, s) : kv * beyond / h;
}

// The torque to report, limited. The implicit integrators take kv times the coming change of speed off it:
// that is the servo's damping, and a free wheel is left a fifth. MuJoCo's forcerange clamps what is reported
// and drops the damping there; a free or slipping wheel (kv h / J = 4) then overshoots at every substep and
// rings. So the limit is put on what the wheel gets, the coming change being guessed as the last one: exact
// at constant acceleration a, else off by kv h (a - a before). After a jump that error shrinks by
// kv h / (J + kv h) a substep (0.81 for the free wheel, 0.25 for one that carries the paper's robot): never
// negative, so it cannot ring, whatever the inertia. A guess that assumes an inertia has no such bound.
//
// Measured on random drives of the packaged robot at 1/480 s: the largest change of a wheel's speed in one
// substep is 6.5 rpm (with forcerange 28 rpm, and 50 rpm to and fro on a slippery floor with twice the limit);
// while limited the wheel gets 4 % more than the limit in the mean, and over 1.2 times it in 0.3 % of substeps.
static double torque(const mjModel* m, const mjData* d, int id, const Drive* s) {
  double limit = m->actuator_user[id * m->nuser_actuator + TORQUE_LIMIT];
  double asked = asked_torque(m, d, id, s), off = damping(m, id, s);
  if (asked - off > limit) return limit + off;
  if (asked - off < -limit) return -limit + off;
  return asked;
}

// Friction of the wheel's bearing: the torque that leaves the wheel at rest after this substep, as far as
// friction goes, coulomb + breakaway exp(-(speed / stribeck)^2). Not MuJoCo's frictionloss: its solver knows the
// bare inertia J, while the implicit step moves J + h kv, four times that and more. So it stops the wheel with too
// small a torque or, at a reversal, pushes it past the setpoint (0.517 N m, servo 0.8, setpoint 4.25 rpm: 6.84 rpm
// instead of 0). Here both are the same, and the free wheel stops and sticks exactly. With more inertia on it (a
// robot) a substep leaves 1 - (J + h kv) / (inertia + h kv) of its speed, never turned round. What else pulls at
// the wheel (a slope) is taken from its motion, smoothed: at full gain wheels that stick on rollers' soft contacts
// tremble by up to 0.5 rpm a substep, at LEARNT not at all.
static double friction(const mjModel* m, const mjData* d, int id, const Drive* s, double drive) {
  double breakaway = option(m, id, BREAKAWAY), stribeck = option(m, id, STRIBECK), most = option(m, id, COULOMB);
  int falls = breakaway > 0 && stribeck > 0;
  if (!(most > 0 || falls)) return 0;
  double perstep = fmax(moved(m, id), mjMINVAL) / m->opt.timestep, left = speed(m, d, id);
  double stop = drive + s->load + left * perstep;
  // The friction that falls with speed is that of the speed it leaves, found by going there from the present one.
  for (int i = 0; i < 3 && falls; i++) {
    double ratio = left / stribeck;
    most = option(m, id, COULOMB) + breakaway * exp(-ratio * ratio);
    left = (stop - mju_clip(stop, -most, most)) / perstep;
  }
  return -mju_clip(stop, -most, most);
}

// The actuator's speed from qvel; d->actuator_velocity stays that of the substep's start until the next one.
static double speed_now(const mjData* d, int out) {
  int first = d->moment_rowadr[out];
  double speed = 0;
  for (int i = first; i < first + d->moment_rownnz[out]; i++)
    speed += d->actuator_moment[i] * d->qvel[d->moment_colind[i]];
  return speed;
}

// The actuator of an instance, -1 if it has none or several.
static int actuator_of(const mjModel* m, int instance) {
  int id = -1;
  for (int i = 0; i < m->nactuator; i++) {
    if (m->actuator_plugin[i] != instance) continue;
    if (id >= 0) return -1;
    id = i;
  }
  return id;
}

static void wheel_compute(const mjModel* m, mjData* d, int instance, int capability) {
  (void)capability;
  int id = actuator_of(m, instance);
  if (id < 0) return;
  Drive s = after_substep(m, d, id, d->plugin_state + m->plugin_stateadr[instance]);
  double drive = torque(m, d, id, &s);
  d->actuator_force[m->actuator_outadr[id]] = drive + friction(m, d, id, &s, drive);
}

static void wheel_advance(const mjModel* m, mjData* d, int instance) {
  int id = actuator_of(m, instance);
  if (id < 0) return;
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  Drive s = after_substep(m, d, id, state);
  int out = m->actuator_outadr[id];
  double h = m->opt.timestep, half = option(m, id, GAP) / 2;
  double asked = asked_torque(m, d, id, &s), drive = torque(m, d, id, &s);
  // Nothing is given while actuation is off.
  double given = d->actuator_force[out] == drive + friction(m, d, id, &s, drive) ? drive : 0;
  // MuJoCo has advanced qvel by now. Taken here and not at the next substep, a speed set by hand in between
  // does not count as acceleration.
  double now = speed_now(d, out);
  s.change = now - d->actuator_velocity[out];
  s.load += LEARNT * (moved(m, id) * s.change / h - d->actuator_force[out] - s.load);
  double before = s.gap;
  s.gap = mju_clip(before + h * (unloaded(m, id, &s) - now), -half, half);
  // The motor's error: in the gap it turns without the wheel.
  double error = s.setpoint - now - (s.gap - before) / h;
  int held = (asked > given && error > 0) || (asked < given && error < 0);
  if (!held) s.integral += h * error;
  memcpy(state, &s, sizeof s);
}

static void wheel_reset(const mjModel* m, mjtNum* state, void* data, int instance) {
  (void)m, (void)data, (void)instance;
  memset(state, 0, sizeof(Drive));
}

static int wheel_nstate(const mjModel* m, int instance) {
  (void)m, (void)instance;
  return NSTATE;
}

// ---------------------------------------------------------------------------------------- checks

#define REFUSE(...) return mju_warning(__VA_ARGS__), -1

static int wheel_init(const mjModel* m, mjData* d, int instance) {
  d->plugin_data[instance] = 0;
  int id = actuator_of(m, instance);
  if (id < 0) REFUSE(PLUGIN_NAME ": instance %d has no actuator or several; one instance drives one wheel", instance);
  char name[100];
  const char* given = mj_id2name(m, mjOBJ_ACTUATOR, id);
  if (given && given[0]) snprintf(name, sizeof name, "%s", given);
  else snprintf(name, sizeof name, "#%d", id);

  static const char* const names[] = {"A", "B", "C", "D", "E", "F", "sample_period_s", "command_period_s",
                                      "command_quantum_rpm", "saturation_rpm"};
  const mjtNum* p = m->actuator_dynprm + id * mjNDYN;
  for (int i = 0; i <= SATURATION; i++) {
    int positive = i == SAMPLE_PERIOD || i == COMMAND_PERIOD;
    if (isfinite(p[i]) && (i < SAMPLE_PERIOD || p[i] > 0 || (!positive && p[i] == 0))) continue;
    REFUSE(PLUGIN_NAME ", actuator \"%s\": %s = dynprm[%d] = %g, must be a finite number%s", name, names[i], i, p[i],
           i < SAMPLE_PERIOD ? "" : positive ? " above 0" : " not below 0 (0: off)");
  }
  double A = p[0], B = p[1], C = p[2];
  if (!(1 - A - B - C > 0 && 3 + A + B - 3 * C > 0 && 1 + A - B + C > 0 && 1 + B + A * C - C * C > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": the wheel law is unstable (A, B, C = %g, %g, %g); all roots of "
           "z^3 - A z^2 - B z - C must lie inside the unit circle", name, A, B, C);
  if (m->actuator_dyntype[id] != mjDYN_NONE)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": dyntype must be none; dynprm holds the wheel law", name);

  const mjtNum* bias = m->actuator_biasprm + id * mjNBIAS;
  double kv = 0 - bias[2];
  if (m->actuator_biastype[id] != mjBIAS_AFFINE || bias[0] != 0 || bias[1] != 0 || !isfinite(kv) || !(kv > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": servo_n_m_s_rad = -biasprm[2] = %g, must be a finite number above 0, with "
           "biastype=\"affine\" biasprm=\"0 0 -servo\" in the actuator's default class", name, kv);
  if (m->nuser_actuator < NUSER)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": nuser_actuator = %d, must be at least %d (user = servo_integral_n_m_rad, "
           "delay_s, torque_limit_n_m; mecanum_env writes 16)", name, (int)m->nuser_actuator, NUSER);
  const mjtNum* user = m->actuator_user + id * m->nuser_actuator;
  if (!isfinite(user[INTEGRAL_GAIN]) || user[INTEGRAL_GAIN] < 0)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": servo_integral_n_m_rad = user[%d] = %g, must be a finite number not below 0",
           name, INTEGRAL_GAIN, user[INTEGRAL_GAIN]);
  double h = m->opt.timestep, longest = (RING - 3) * p[COMMAND_PERIOD] - h;
  if (!(h <= MAX_EVENTS * p[SAMPLE_PERIOD]) || !(longest >= 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": timestep = %g s, must be at most %d sample periods of %g s and %d command "
           "periods of %g s", name, h, MAX_EVENTS, p[SAMPLE_PERIOD], RING - 3, p[COMMAND_PERIOD]);
  if (!(user[DELAY] >= 0) || !(user[DELAY] <= longest))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": delay_s = user[%d] = %g, must be 0 to %g (%d command periods less a "
           "timestep)", name, DELAY, user[DELAY], longest, RING - 3);
  if (!(user[TORQUE_LIMIT] > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": torque_limit_n_m = user[%d] = %g, must be above 0 (1e10 or inf: no limit)",
           name, TORQUE_LIMIT, user[TORQUE_LIMIT]);
  static const char* const options[] = {"command_deadband.threshold_rpm", "gain", "reverse_ratio",
                                        "battery_sag.drop_per_s", "speed_saturation.softness_rpm",
                                        "acceleration_limit.limit_rpm_s", "backlash, in rad",
                                        "stiction.breakaway_n_m", "stiction.stribeck, in rad/s",
                                        "coulomb_friction.torque_n_m", "the wheel's inertia, in kg m^2"};
  for (int i = DEADBAND; i < LAST_USER; i++)
    if (!(option(m, id, i) >= 0) || !isfinite(option(m, id, i)))
      REFUSE(PLUGIN_NAME ", actuator \"%s\": %s = user[%d] = %g, must be a finite number not below 0 (0: off)", name,
             options[i - DEADBAND], i, option(m, id, i));
  if (m->actuator_forcelimited[id])
    REFUSE(PLUGIN_NAME ", actuator \"%s\": forcerange is MuJoCo's own limit, with which a free wheel rings; write "
           "forcelimited=\"false\" and the limit to user[%d]", name, TORQUE_LIMIT);
  if (m->actuator_history[2 * id] > 0 || m->actuator_delay[id] != 0)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": nsample and delay are MuJoCo's own delay, which this plugin does not use; "
           "write the delay to user[%d]", name, DELAY);
  return 0;
}

mjPLUGIN_LIB_INIT(mecanum_wheel) {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = PLUGIN_NAME;
  plugin.capabilityflags = mjPLUGIN_ACTUATOR;
  plugin.needstage = mjSTAGE_VEL;
  plugin.nstate = wheel_nstate;
  plugin.init = wheel_init;
  plugin.reset = wheel_reset;
  plugin.compute = wheel_compute;
  plugin.advance = wheel_advance;
  mjp_registerPlugin(&plugin);
}
