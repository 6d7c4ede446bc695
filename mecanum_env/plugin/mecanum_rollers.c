// Passive plugin "mecanum.rollers": the friction of the rollers of a robot that slides on the plane.
//
// It belongs to a body on three joints: slides along the world's x and y, then a hinge about z. The friction acts along
// the body's y, which no joint of MuJoCo has. All parameters are user data of the body, read anew at each call; the
// plugin has no state.

#include <math.h>

#include <mujoco/mujoco.h>

#include "mecanum_rollers.h"
#include "rollers.h"

#define PLUGIN_NAME "mecanum.rollers"
#define REFUSE(...) return mju_warning(__VA_ARGS__), -1

enum { JOINTS = 3 };

// The body of a plugin instance; -1 if it has none.
static int body_of(const mjModel* m, int instance) {
  for (int i = 0; i < m->nbody; i++)
    if (m->body_plugin[i] == instance) return i;
  return -1;
}

static void rollers_compute(const mjModel* m, mjData* d, int instance, int capability) {
  (void)capability;
  int body = body_of(m, instance);
  if (body < 0) return;
  int dof = m->body_dofadr[body];
  double yaw = d->qpos[m->jnt_qposadr[m->body_jntadr[body] + 2]], cosine = cos(yaw), sine = sin(yaw);
  double left = cosine * d->qvel[dof + 1] - sine * d->qvel[dof], force = 0, moment = 0;
  rollers_hold(m->body_user + body * m->nuser_body, left, d->qvel[dof + 2], &force, &moment);
  d->qfrc_passive[dof] -= sine * force;
  d->qfrc_passive[dof + 1] += cosine * force;
  d->qfrc_passive[dof + 2] += moment;
}

static int rollers_nstate(const mjModel* m, int instance) {
  (void)m, (void)instance;
  return 0;
}

static int rollers_init(const mjModel* m, mjData* d, int instance) {
  d->plugin_data[instance] = 0;
  int body = body_of(m, instance);
  if (body < 0) REFUSE(PLUGIN_NAME ": instance %d belongs to no body", instance);
  if (m->nuser_body < N_ROLLERS)
    REFUSE(PLUGIN_NAME ": nuser_body = %d, must be at least %d (user = friction sideways of a wheel [N], the same for "
           "each m/s [N s/m], half wheelbase [m], speed from which the friction is whole [m/s])",
           (int)m->nuser_body, N_ROLLERS);
  const int types[JOINTS] = {mjJNT_SLIDE, mjJNT_SLIDE, mjJNT_HINGE};
  int fits = m->body_jntnum[body] == JOINTS;
  for (int i = 0; fits && i < JOINTS; i++) fits = m->jnt_type[m->body_jntadr[body] + i] == types[i];
  if (!fits) REFUSE(PLUGIN_NAME ": the joints of its body must be slides along x and y and a hinge about z");
  const mjtNum* user = m->body_user + body * m->nuser_body;
  if (!(user[RUB] >= 0 && user[DRAG] >= 0 && isfinite(user[RUB]) && isfinite(user[DRAG])))
    REFUSE(PLUGIN_NAME ": friction of %g N and %g N s/m, must be finite and not below 0", user[RUB], user[DRAG]);
  if (user[RUB] > 0 && !(user[REST] > 0))
    REFUSE(PLUGIN_NAME ": the speed from which the friction is whole = %g m/s, must be above 0", user[REST]);
  return 0;
}

void mecanum_rollers_register(void) {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = PLUGIN_NAME;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = rollers_nstate;
  plugin.init = rollers_init;
  plugin.compute = rollers_compute;
  mjp_registerPlugin(&plugin);
}
