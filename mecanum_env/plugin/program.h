// Programs of custom effects: rows of numbers that are run on a stack. mecanum_env/wheel_drive/program.py has the same
// operations, makes the programs and says what they mean; the tests hold the two equal bit for bit.
//
// A program comes from a model's numeric field, which may hold anything: running one never reads or writes beyond it.

#ifndef MECANUM_PROGRAM_H
#define MECANUM_PROGRAM_H

#include <stdint.h>

#define PROGRAM_SIZE 48   // numbers of a program, padded with 0
#define STACK_SIZE 16     // most values that wait on the stack
#define LARGEST_TABLE 16  // most knots of a table

enum {
  OP_END, OP_NUMBER,
  OP_COMMAND, OP_SPEED, OP_ANGLE, OP_TIME, OP_VOLTAGE,
  OP_TABLE,  // followed by the number of knots, the knots and the values
  OP_NEGATIVE, OP_ABS, OP_SIGN, OP_SIN, OP_COS, OP_EXP,
  OP_ADD, OP_SUBTRACT, OP_MULTIPLY, OP_DIVIDE, OP_POWER, OP_MIN, OP_MAX,
  N_OPERATIONS
};

typedef struct {
  double command;  // [rpm]
  double speed;    // of the wheel [rpm]
  double angle;    // of the wheel since the start [rad]
  double time;     // since the clocks started [s]
  double voltage;  // of the supply below that at the start [V]; 0 where unknown
} Inputs;

// The value of a program; 0 if it is empty, no program, or has an operation without a finite result.
double program_value(const double program[PROGRAM_SIZE], const Inputs* inputs);

// Whether the numbers are a program, or none at all.
int program_is_valid(const double program[PROGRAM_SIZE]);

// program_value at n moments: `inputs` (n, 5) in the order of Inputs, `values` (n).
__attribute__((visibility("default"))) void mecanum_evaluate(const double* program, int64_t n, const double* inputs,
                                                             double* values);

#endif
