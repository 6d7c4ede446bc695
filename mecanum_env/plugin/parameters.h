// The parameters of a wheel's drive: their order, their names, and which values it refuses.

#ifndef MECANUM_PARAMETERS_H
#define MECANUM_PARAMETERS_H

#include <stdint.h>

#include "program.h"

#define EXPORT __attribute__((visibility("default")))  // for other programs, which call it through a pointer

#define RING 64         // latched commands kept, which bounds the delay
#define MAX_EVENTS 1024 // law ticks or latches in one substep, at most
#define MAP_KNOTS 6     // knots of a static map, at most
#define EPS 1e-9        // tolerance of the clocks, relative to their period
#define SPREAD 1.7320508075688772  // largest deviation of a delay in multiples of the jitter

// All parameters in order: X(index, name, check). mecanum_env/wheel_drive/parameters.py has the same names; a test holds
// the two lists equal. The law's are the actuator's dynprm, the servo is -biasprm[2], and the others are user[0],
// user[1] ... From DEADBAND on 0 means "off", also for a gain, and a model may leave them out.
#define LAW_PARAMETERS(X)                      \
  X(LAW_A, "A", FINITE)                        \
  X(LAW_B, "B", FINITE)                        \
  X(LAW_C, "C", FINITE)                        \
  X(LAW_D, "D", FINITE)                        \
  X(LAW_E, "E", FINITE)                        \
  X(LAW_F, "F", FINITE)                        \
  X(SAMPLE_PERIOD, "sample_period_s", ABOVE_0) \
  X(COMMAND_PERIOD, "command_period_s", ABOVE_0) \
  X(QUANTUM, "command_quantum_rpm", NOT_BELOW_0) \
  X(SATURATION, "saturation_rpm", NOT_BELOW_0)
#define USER_PARAMETERS(X)                                  \
  X(INTEGRAL_GAIN, "servo_integral_n_m_rad", NOT_BELOW_0)   \
  X(DELAY, "delay_s", ITS_OWN)                              \
  X(TORQUE_LIMIT, "torque_limit_n_m", ITS_OWN)              \
  X(DEADBAND, "deadband_rpm", NOT_BELOW_0)                  \
  X(GAIN, "gain", NOT_BELOW_0)                              \
  X(REVERSE_RATIO, "reverse_ratio", NOT_BELOW_0)            \
  X(DROP, "drop_per_s", NOT_BELOW_0)                        \
  X(SOFTNESS, "softness_rpm", NOT_BELOW_0)                  \
  X(ACCELERATION, "acceleration_rpm_s", NOT_BELOW_0)        \
  X(GAP, "gap_rad", NOT_BELOW_0)                            \
  X(BREAKAWAY, "breakaway_n_m", NOT_BELOW_0)                \
  X(STRIBECK, "stribeck_rad_s", NOT_BELOW_0)                \
  X(COULOMB, "coulomb_n_m", NOT_BELOW_0)                    \
  X(INERTIA, "inertia_kg_m2", NOT_BELOW_0)                  \
  X(DRIVE_RISE, "drive_acceleration_rpm_s", NOT_BELOW_0)    \
  X(DRIVE_BRAKE, "drive_brake_rpm_s", NOT_BELOW_0)          \
  X(SUPPLY, "supply_rpm", NOT_BELOW_0)                      \
  X(SUPPLY_SHARE, "supply_share", NOT_BELOW_0)              \
  X(ROTOR, "rotor_kg_m2", NOT_BELOW_0)                      \
  X(VISCOUS, "viscous_n_m_s_rad", NOT_BELOW_0)              \
  X(WARM_SHARE, "friction_warm_share", NOT_BELOW_0)         \
  X(WARM_TIME, "friction_warm_s", NOT_BELOW_0)              \
  X(RIPPLE, "ripple_n_m", NOT_BELOW_0)                      \
  X(RIPPLE_SHARE, "ripple_share", NOT_BELOW_0)              \
  X(RIPPLE_PER_TURN, "ripple_per_turn", NOT_BELOW_0)        \
  X(RIPPLE_PHASE, "ripple_phase_rad", FINITE)               \
  X(GAP_KIND, "gap_kind", NOT_BELOW_0)                      \
  X(SUBTRACTED, "subtracted_rpm", NOT_BELOW_0)              \
  X(WARM_UP, "warm_up_share", WITHIN_1)                     \
  X(WARM_UP_TIME, "warm_up_s", NOT_BELOW_0)                 \
  X(MAP_SIZE, "map_knots", ITS_OWN)                         \
  X(KNOT_1, "knot_1_rpm", FINITE)                           \
  X(KNOT_2, "knot_2_rpm", FINITE)                           \
  X(KNOT_3, "knot_3_rpm", FINITE)                           \
  X(KNOT_4, "knot_4_rpm", FINITE)                           \
  X(KNOT_5, "knot_5_rpm", FINITE)                           \
  X(KNOT_6, "knot_6_rpm", FINITE)                           \
  X(VALUE_1, "value_1_rpm", FINITE)                         \
  X(VALUE_2, "value_2_rpm", FINITE)                         \
  X(VALUE_3, "value_3_rpm", FINITE)                         \
  X(VALUE_4, "value_4_rpm", FINITE)                         \
  X(VALUE_5, "value_5_rpm", FINITE)                         \
  X(VALUE_6, "value_6_rpm", FINITE)                         \
  X(BRAKE, "brake_rpm_s", NOT_BELOW_0)                      \
  X(JERK, "jerk_rpm_s2", NOT_BELOW_0)                       \
  X(JITTER, "jitter_s", ITS_OWN)                            \
  X(LOSS, "loss", PART)                                     \
  X(SEED, "link_seed", NOT_BELOW_0)                         \
  X(GAIN_PER_VOLT, "gain_per_volt", NOT_BELOW_0)            \
  X(SUPPLY_PER_VOLT, "supply_per_volt", NOT_BELOW_0)        \
  X(GAP_SWING, "gap_swing_rad_s", NOT_BELOW_0)              \
  X(GAP_DAMPING, "gap_damping", NOT_BELOW_0)                \
  X(GAP_SLOWING, "gap_slowing_rad_s2", NOT_BELOW_0)         \
  X(SERVO_WINDUP, "servo_windup", PART)                     \
  X(LAW_WINDUP, "windup", PART)                             \
  X(VISCOUS_WARM_SHARE, "viscous_warm_share", NOT_BELOW_0)

// What the wheel does while the motor crosses the backlash, as values of GAP_KIND.
enum { COAST, LIGHT };

#define INDEX(index, name, check) index,
enum { LAW_PARAMETERS(INDEX) SERVO, USER_PARAMETERS(INDEX) N_PARAMETERS };
enum { N_LAW = SERVO, FIRST_USER = SERVO + 1, N_USER = N_PARAMETERS - FIRST_USER };
#undef INDEX

// The programs of custom effects follow the parameters; in the actuator they begin at user[FIRST_PROGRAM].
enum { AT_COMMAND, AT_SET_POINT, AT_LOAD, N_STATIONS };
enum { FIRST_PROGRAM = 128, N_PROGRAMS = N_STATIONS * PROGRAM_SIZE, N_NUMBERS = N_PARAMETERS + N_PROGRAMS };
#define PROGRAM(p, station) ((p) + N_PARAMETERS + (station) * PROGRAM_SIZE)

// Hash of the sources that the library was compiled from, as CMakeLists.txt makes it; "" if it was compiled by hand.
EXPORT const char* mecanum_sources(void);

// The name of a parameter by its index; NULL beyond the last.
EXPORT const char* mecanum_parameter(int64_t index);

// Whether a drive refuses N_NUMBERS parameters p with substeps of h [s]; if so, `message` of at most `size` bytes says why.
EXPORT int32_t mecanum_refuses(const double* p, double h, char* message, int64_t size);

#endif
