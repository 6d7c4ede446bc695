// The parameters of a drive: their names, and which values are refused.

#include <math.h>
#include <stdio.h>

#include "parameters.h"

typedef enum { FINITE, ABOVE_0, NOT_BELOW_0, WITHIN_1, PART, ITS_OWN } Check;

#define ROW(index, name, check) {name, check},
static const struct { const char* name; Check check; } PARAMETERS[] = {
  LAW_PARAMETERS(ROW) {"servo_n_m_s_rad", ABOVE_0}, USER_PARAMETERS(ROW)};
#undef ROW
_Static_assert(sizeof PARAMETERS / sizeof *PARAMETERS == N_PARAMETERS, "one row for each index");

#ifndef SOURCES_SHA256
#define SOURCES_SHA256 ""
#endif

const char* mecanum_sources(void) {
  return SOURCES_SHA256;
}

const char* mecanum_parameter(int64_t index) {
  return index >= 0 && index < N_PARAMETERS ? PARAMETERS[index].name : 0;
}

static int passes(double value, Check check) {
  if (check == ITS_OWN) return 1;
  if (check == WITHIN_1) return fabs(value) < 1;
  if (check == PART) return value >= 0 && value <= 1;
  return isfinite(value) && (check == FINITE || value > 0 || (check == NOT_BELOW_0 && value == 0));
}

// Whether a drive has no static map, or one whose knots increase and whose values do not decrease; a mirrored one
// begins at 0.
static int map_is_possible(const double* p) {
  const double *x = p + KNOT_1, *y = p + VALUE_1;
  double n = p[MAP_SIZE];
  if (!(n >= 0 && n <= MAP_KNOTS && n == floor(n))) return 0;
  for (int i = 1; i < n; i++)
    if (!(x[i] > x[i - 1] && y[i] >= y[i - 1])) return 0;
  if (n == 0) return 1;
  return x[(int)n - 1] >= 0 && (x[0] < 0 || y[0] == 0 || (x[0] > 0 && y[0] > 0));
}

#define REFUSE(...) return snprintf(message, size, __VA_ARGS__), 1

int32_t mecanum_refuses(const double* p, double h, char* message, int64_t size) {
  static const char* const wanted[] = {"", " above 0", " not below 0 (0: off)", " between -1 and 1 (0: off)", " from 0 to 1"};
  for (int i = 0; i < N_PARAMETERS; i++) {
    Check check = PARAMETERS[i].check;
    if (passes(p[i], check)) continue;
    REFUSE("%s = %s[%d] = %g, must be a finite number%s", PARAMETERS[i].name,
           i < SERVO ? "dynprm" : i == SERVO ? "-biasprm" : "user",
           i < SERVO ? i : i == SERVO ? 2 : i - FIRST_USER, p[i], wanted[check]);
  }
  static const char* const stations[] = {"command", "set_point", "load"};
  for (int i = 0; i < N_STATIONS; i++)
    if (!program_is_valid(PROGRAM(p, i)))
      REFUSE("custom effect of the station %s = user[%d] ..., must be a program (mecanum_env/wheel_drive/program.py)",
             stations[i], FIRST_PROGRAM + i * PROGRAM_SIZE);
  double A = p[LAW_A], B = p[LAW_B], C = p[LAW_C];
  if (!(1 - A - B - C > 0 && 3 + A + B - 3 * C > 0 && 1 + A - B + C > 0 && 1 + B + A * C - C * C > 0))
    REFUSE("the wheel law is unstable (A, B, C = %g, %g, %g); all roots of z^3 - A z^2 - B z - C must lie inside the "
           "unit circle", A, B, C);
  double longest = (RING - 3) * p[COMMAND_PERIOD] - h;
  if (!(h <= MAX_EVENTS * p[SAMPLE_PERIOD]) || !(longest >= 0))
    REFUSE("timestep = %g s, must be at most %d sample periods of %g s and %d command periods of %g s", h, MAX_EVENTS,
           p[SAMPLE_PERIOD], RING - 3, p[COMMAND_PERIOD]);
  if (!(p[DELAY] >= 0) || !(p[DELAY] <= longest))
    REFUSE("delay_s = user[%d] = %g, must be 0 to %g (%d command periods less a timestep)", DELAY - FIRST_USER,
           p[DELAY], longest, RING - 3);
  if (!(p[JITTER] >= 0) || !(p[DELAY] + SPREAD * p[JITTER] <= longest))
    REFUSE("jitter_s = user[%d] = %g, must not be below 0, and delay_s + %g jitter_s at most %g (%d command periods less "
           "a timestep)", JITTER - FIRST_USER, p[JITTER], SPREAD, longest, RING - 3);
  if (!map_is_possible(p))
    REFUSE("map_knots = user[%d] = %g: must be a number of knots up to %d that increase and reach 0, with values that "
           "do not decrease; 0 or more, and 0 at 0, without a knot below 0", MAP_SIZE - FIRST_USER, p[MAP_SIZE],
           MAP_KNOTS);
  if (!(p[TORQUE_LIMIT] > 0))
    REFUSE("torque_limit_n_m = user[%d] = %g, must be above 0 (1e10 or inf: no limit)", TORQUE_LIMIT - FIRST_USER,
           p[TORQUE_LIMIT]);
  return 0;
}
