// Contact between the floor and a roller that is rounder than an ellipsoid, in MuJoCo's table of collision functions.
//
// The rollers of a Mecanum wheel are barrels whose envelope is a circle. With few rollers on a wheel an ellipsoid is
// far from that: it climbs at each roller. An ellipsoid with user data is taken for such a barrel here; all others
// collide as MuJoCo's own. (mecanum_env/mjcf/geometry.py has the shape.)

#include <math.h>

#include <mujoco/mujoco.h>

#include "roller_contact.h"

enum { CIRCLE, END, N_BARREL };  // user data: radius of the rollers' circle [m], largest sine of the latitude

static mjfCollision plane_ellipsoid;  // MuJoCo's own

// A barrel touches a plane, at latitude asin(u), in the point `along` its axis and `out` from it [m]; returns how far
// the barrel reaches in that direction. Beyond its ends it has a rim.
static double barrel(double radius, double circle, double end, double u, double* along, double* out) {
  double sine = fmin(fabs(u), end), cosine = sqrt(1 - sine * sine), root = sqrt(1 - 2 * sine * sine);
  double reach = radius - circle * root, slope = 2 * circle * sine / root * cosine;
  double x = reach * sine + slope * cosine;
  *along = u < 0 ? -x : x;
  *out = reach * cosine - slope * sine;
  return *along * u + *out * sqrt(fmax(0, 1 - u * u));
}

static int plane_roller(const mjModel* m, mjData* d, mjPreContact* con, int plane, int roller, mjtNum margin) {
  const mjtNum* user = m->geom_user + roller * m->nuser_geom;
  if (m->nuser_geom < N_BARREL || !(user[CIRCLE] > 0)) return plane_ellipsoid(m, d, con, plane, roller, margin);
  const mjtNum *floor = d->geom_xpos + 3 * plane, *turn = d->geom_xmat + 9 * plane;
  const mjtNum *centre = d->geom_xpos + 3 * roller, *turned = d->geom_xmat + 9 * roller;
  double up[3] = {turn[2], turn[5], turn[8]}, axis[3] = {turned[2], turned[5], turned[8]};
  double height = 0, u = 0, along, out;
  for (int i = 0; i < 3; i++) height += up[i] * (centre[i] - floor[i]), u -= up[i] * axis[i];
  double distance = height - barrel(m->geom_size[3 * roller] + user[CIRCLE], user[CIRCLE], user[END], u, &along, &out);
  if (distance > margin) return 0;
  double across = sqrt(fmax(0, 1 - u * u));
  con->dist = distance;
  for (int i = 0; i < 3; i++) {
    // Square to the axis, towards the floor; a roller that stands upright has no such direction.
    double down = across > 1e-9 ? (-up[i] - u * axis[i]) / across : 0;
    con->pos[i] = centre[i] + along * axis[i] + out * down - up[i] * distance / 2;
    con->normal[i] = up[i];
    con->tangent[i] = 0;
  }
  return 1;
}

void roller_contact_register(void) {
  if (plane_ellipsoid) return;
  plane_ellipsoid = mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_ELLIPSOID];
  mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_ELLIPSOID] = plane_roller;
}
