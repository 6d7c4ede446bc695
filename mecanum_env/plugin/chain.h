// The drive of one wheel, from the command that is sent to the torque on the wheel, without MuJoCo.
//
// In each substep n, at time n*h: latch and shape the command when due, tick the wheel law when due, move the
// setpoint linearly from w(k) to w(k+1), and hold it with a (PI) velocity servo:
//
//   w(k+1) = A w(k) + B w(k-1) + C w(k-2) + D r(k) + E r(k-1) + F r(k-2)          [rpm]
//   torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]
//
// The motor may bound the step from w(k) to w(k+1); as the law's memory is the wheel's own speed, nothing winds up.
// The torque is limited to torque_limit_n_m. J is the inertia of the free wheel; fed forward, it makes the free wheel
// follow the setpoint without lag. A rotor is the part of J that the limit leaves alone. Friction of the wheel's
// bearing acts beside this torque.
//
// A substep is: chain_begin, chain_torques, the motion of the wheel under these torques, chain_end. The way from the
// command to r(k) is in set_point.c, the rest in chain.c. Around it stand the actuator plugin (mecanum_wheel.c) and
// the bench (bench.c). mecanum_env/law is the same chain in Python; the tests hold the two equal bit for bit.

#ifndef MECANUM_CHAIN_H
#define MECANUM_CHAIN_H

#include <stdint.h>

#include "program.h"

#define EXPORT __attribute__((visibility("default")))  // for other programs, which call it through a pointer

#define RING 64         // latched commands kept, which bounds the delay
#define MAX_EVENTS 1024 // law ticks or latches in one substep, at most
#define MAP_KNOTS 6     // knots of a static map, at most
#define EPS 1e-9        // tolerance of the clocks, relative to their period
#define SPREAD 1.7320508075688772  // largest deviation of a delay in multiples of the jitter
#define RAD_S_PER_RPM (2.0 * 3.141592653589793 / 60.0)

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
  X(SUPPLY_PER_VOLT, "supply_per_volt", NOT_BELOW_0)

// What the wheel does while the motor crosses the backlash, as values of GAP_KIND.
enum { COAST, REST, SPRING };

#define INDEX(index, name, check) index,
enum { LAW_PARAMETERS(INDEX) SERVO, USER_PARAMETERS(INDEX) N_PARAMETERS };
enum { N_LAW = SERVO, FIRST_USER = SERVO + 1, N_USER = N_PARAMETERS - FIRST_USER };
#undef INDEX

// The programs of custom effects follow the parameters; in the actuator they begin at user[FIRST_PROGRAM].
enum { AT_COMMAND, AT_SET_POINT, AT_LOAD, N_STATIONS };
enum { FIRST_PROGRAM = 128, N_PROGRAMS = N_STATIONS * PROGRAM_SIZE, N_NUMBERS = N_PARAMETERS + N_PROGRAMS };
#define PROGRAM(p, station) ((p) + N_PARAMETERS + (station) * PROGRAM_SIZE)

typedef struct {
  double substeps, ticks, latches;                 // counts since the clocks started
  double timestep, sample_period, command_period;  // the clocks in use [s]; another value restarts them
  double w0, w1, w2, r1, r2;                       // the law's memory [rpm]: w0 = w(k+1), w1 = w(k)
  double ramp;                                     // command behind the acceleration limit at the tick's end [rpm]
  double setpoint;                                 // setpoint at the end of the last substep [rad/s]
  double rise;                                     // change of the setpoint in the last substep [rad/s]
  double integral;                                 // integral of setpoint - speed of the motor [rad]
  double change;                                   // change of the wheel's speed in the last substep [rad/s]
  double gap;                                      // motor minus wheel in the backlash, +- half of it [rad]
  double load;                                     // torque of everything else on the wheel, smoothed [N m]
  double angle;                                    // turned by the wheel since the start [rad]
  double slope;                                    // the S-curve's rate of change at the end of the tick [rpm/s]
  double sent;                                     // the last command that was not lost, before it is shaped [rpm]
  double command[RING];                            // latched command j at j modulo RING [rpm]
  double arrival[RING];                            // when it arrives, if the delay jitters [s]
} Drive;

// What the drive meets in a substep.
typedef struct {
  double command;   // command that is sent [rpm]
  double speed;     // the wheel's speed at the start of the substep [rad/s]
  double timestep;  // h [s]
  int implicit;     // whether the integrator subtracts kv times the coming change of speed from the torque
  double lost_v;    // voltage of the supply below that at the start [V]; 0 where it is not known
} Substep;

typedef struct {
  double asked;     // torque that the servo asks for [N m]
  double drive;     // the same, limited [N m]
  double custom;    // of a custom effect that loads the wheel [N m]
  double friction;  // of the wheel's bearing [N m]
} Torques;

// Hash of the sources that the library was compiled from, as CMakeLists.txt makes it; "" if it was compiled by hand.
EXPORT const char* mecanum_sources(void);

// The name of a parameter by its index; NULL beyond the last.
EXPORT const char* mecanum_parameter(int64_t index);

// Whether a drive refuses N_NUMBERS parameters p with substeps of h [s]; if so, `message` of at most `size` bytes says why.
EXPORT int32_t mecanum_refuses(const double* p, double h, char* message, int64_t size);

// A command [rpm] or voltage [V]; NaN and absurd values count as 0, as for MuJoCo's own actuators.
double chain_sane(double given);

// Latch the command that is sent [rpm], shaped as the drive does it.
void set_point_latch(Drive* s, const double* p, const Substep* now);

// The law's input r(k) [rpm]: the mean over the coming tick of the delayed command behind the acceleration limit. Only
// commands latched by the start of the tick count.
double set_point_input(Drive* s, const double* p);

// Start the clocks of commands and ticks anew; the last command holds on.
void set_point_restart(Drive* s);

// Advance the clocks, the law and the setpoint to the end of the substep; the rest of the drive is chain_end's.
void chain_begin(Drive* s, const double* p, const Substep* now);

// The torques to report: an implicit integrator subtracts kv times the coming change of speed from their sum.
Torques chain_torques(const Drive* s, const double* p, const Substep* now);

// Their sum.
double chain_reported(const Torques* t);

// Take over the substep's motion: the wheel's speed at its end [rad/s], the drive's torque that was delivered (0 while
// actuation is disabled) and the whole torque that was reported [N m].
void chain_end(Drive* s, const double* p, const Substep* now, double asked, double delivered, double reported,
               double speed);

#endif
