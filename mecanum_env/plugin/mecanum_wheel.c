// Actuator plugin "mecanum.wheel": one identified wheel drive, command [rpm] in, torque [N m] out.
//
// This is MuJoCo's side of it; the drive itself is in chain.h. All parameters are numeric fields of the actuator and
// read anew at each call, so copies, pickles, batches of different models and edits of a compiled model work. All
// memory is in plugin_state (mecanum_env/plugin/layout.py names the entries), written in reset and advance only.

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <mujoco/mujoco.h>

#include "chain.h"
#include "mecanum_rollers.h"
#include "roller_contact.h"
#include "set_point.h"

#define PLUGIN_NAME "mecanum.wheel"

_Static_assert(sizeof(mjtNum) == sizeof(double), "the plugin needs MuJoCo in double precision");
enum { LOST_VOLTAGE = 0 };  // index in userdata (mecanum_env/plugin/layout.py)
enum { NSTATE = sizeof(Drive) / sizeof(double), NEEDED_USER = DEADBAND - FIRST_USER };
_Static_assert((int)N_USER <= (int)FIRST_PROGRAM, "the named parameters end before the programs");

// The actuator of a plugin instance; -1 if it has none or several.
static int actuator_of(const mjModel* m, int instance) {
  int id = -1;
  for (int i = 0; i < m->nactuator; i++) {
    if (m->actuator_plugin[i] != instance) continue;
    if (id >= 0) return -1;
    id = i;
  }
  return id;
}

// The parameters of an actuator; what the model leaves out is 0.
static void read_parameters(const mjModel* m, int id, double p[N_NUMBERS]) {
  const mjtNum* user = m->actuator_user + id * m->nuser_actuator;
  int size = m->nuser_actuator, given = size < N_USER ? size : N_USER;
  int programs = size < FIRST_PROGRAM + N_PROGRAMS ? size - FIRST_PROGRAM : N_PROGRAMS;
  memcpy(p, m->actuator_dynprm + id * mjNDYN, N_LAW * sizeof *p);
  p[SERVO] = -m->actuator_biasprm[id * mjNBIAS + 2];
  memset(p + FIRST_USER, 0, (N_NUMBERS - FIRST_USER) * sizeof *p);
  memcpy(p + FIRST_USER, user, given * sizeof *p);
  if (programs > 0) memcpy(p + N_PARAMETERS, user + FIRST_PROGRAM, programs * sizeof *p);
}

// The command as MuJoCo clamps it.
static double received(const mjModel* m, const mjData* d, int id) {
  int adr = m->actuator_ctrladr[id];
  double u = set_point_sane(d->ctrl[adr]);
  if (m->actuator_ctrllimited[adr] && !(m->opt.disableflags & mjDSBL_CLAMPCTRL))
    u = mju_clip(u, m->actuator_ctrlrange[2 * adr], m->actuator_ctrlrange[2 * adr + 1]);
  return u;
}

// The voltage that the supply has lost [V], as the program that steps the model has written it.
static double lost_voltage(const mjModel* m, const mjData* d) {
  return m->nuserdata > LOST_VOLTAGE ? set_point_sane(d->userdata[LOST_VOLTAGE]) : 0;
}

static Substep this_substep(const mjModel* m, const mjData* d, int id) {
  int implicit = m->opt.integrator == mjINT_IMPLICIT || m->opt.integrator == mjINT_IMPLICITFAST;
  double speed = d->actuator_velocity[m->actuator_outadr[id]];
  return (Substep){received(m, d, id), speed, m->opt.timestep, implicit, lost_voltage(m, d)};
}

// The actuator's speed from qvel; d->actuator_velocity is still that of the start of the substep.
static double speed_now(const mjData* d, int out) {
  int first = d->moment_rowadr[out];
  double speed = 0;
  for (int i = first; i < first + d->moment_rownnz[out]; i++)
    speed += d->actuator_moment[i] * d->qvel[d->moment_colind[i]];
  return speed;
}

// An actuator in one substep: its number, parameters and drive, what it is given, and the torques that follow.
typedef struct {
  int id;
  double p[N_NUMBERS];
  Drive drive;
  Substep now;
  Torques torques;
} Moment;

// Returns 0 if the instance belongs to no actuator.
static int moment_of(const mjModel* m, const mjData* d, int instance, Moment* a) {
  a->id = actuator_of(m, instance);
  if (a->id < 0) return 0;
  read_parameters(m, a->id, a->p);
  a->now = this_substep(m, d, a->id);
  memcpy(&a->drive, d->plugin_state + m->plugin_stateadr[instance], sizeof a->drive);
  chain_begin(&a->drive, a->p, &a->now);
  a->torques = chain_torques(&a->drive, a->p, &a->now);
  return 1;
}

static void wheel_compute(const mjModel* m, mjData* d, int instance, int capability) {
  (void)capability;
  Moment a;
  if (!moment_of(m, d, instance, &a)) return;
  d->actuator_force[m->actuator_outadr[a.id]] = chain_reported(&a.torques);
}

static void wheel_advance(const mjModel* m, mjData* d, int instance) {
  Moment a;
  if (!moment_of(m, d, instance, &a)) return;
  int out = m->actuator_outadr[a.id];
  // While actuation is disabled, MuJoCo has cleared the force, and the drive delivers nothing.
  double force = d->actuator_force[out];
  double delivered = force == chain_reported(&a.torques) ? a.torques.drive : 0;
  // MuJoCo has advanced qvel already. Read here rather than in the next substep, so that a speed set by hand in
  // between does not count as acceleration.
  chain_end(&a.drive, a.p, &a.now, a.torques.asked, delivered, force, speed_now(d, out));
  memcpy(d->plugin_state + m->plugin_stateadr[instance], &a.drive, sizeof a.drive);
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

  if (m->actuator_dyntype[id] != mjDYN_NONE)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": dyntype must be none; dynprm holds the wheel law", name);
  const mjtNum* bias = m->actuator_biasprm + id * mjNBIAS;
  double kv = 0 - bias[2];
  if (m->actuator_biastype[id] != mjBIAS_AFFINE || bias[0] != 0 || bias[1] != 0 || !isfinite(kv) || !(kv > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": servo_n_m_s_rad = -biasprm[2] = %g, must be a finite number above 0, with "
           "biastype=\"affine\" biasprm=\"0 0 -servo\" in the actuator's default class", name, kv);
  if (m->nuser_actuator < NEEDED_USER)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": nuser_actuator = %d, must be at least %d (user = servo_integral_n_m_rad, "
           "delay_s, torque_limit_n_m and, for effects, more)", name, (int)m->nuser_actuator, NEEDED_USER);
  double p[N_NUMBERS];
  read_parameters(m, id, p);
  char why[400];
  if (mecanum_refuses(p, m->opt.timestep, why, sizeof why)) REFUSE(PLUGIN_NAME ", actuator \"%s\": %s", name, why);
  if (m->actuator_forcelimited[id])
    REFUSE(PLUGIN_NAME ", actuator \"%s\": forcerange is MuJoCo's own limit, with which a free wheel rings; write "
           "forcelimited=\"false\" and the limit to user[%d]", name, TORQUE_LIMIT - FIRST_USER);
  if (m->actuator_history[2 * id] > 0 || m->actuator_delay[id] != 0)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": nsample and delay are MuJoCo's own delay, which this plugin does not use; "
           "write the delay to user[%d]", name, DELAY - FIRST_USER);
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
  mecanum_rollers_register();
  roller_contact_register();
}
