// Programs of custom effects; program.h says what they are.

#include "program.h"

#include <math.h>

typedef struct {
  double values[STACK_SIZE];
  int depth;
  int valid;  // whether all instructions could be read so far
} Stack;

static double input(const Inputs* in, int op) {
  switch (op) {
    case OP_COMMAND: return in->command;
    case OP_SPEED: return in->speed;
    case OP_ANGLE: return in->angle;
    case OP_TIME: return in->time;
    default: return in->voltage;
  }
}

static double pop(Stack* s) {
  if (s->depth > 0) return s->values[--s->depth];
  s->valid = 0;
  return 0;
}

static void push(Stack* s, double value) {
  if (s->depth < STACK_SIZE) s->values[s->depth++] = value;
  else s->valid = 0;
}

// A whole number from 0 to `largest`; -1 if it is none.
static int whole(double number, int largest) {
  return number >= 0 && number <= largest && number == floor(number) ? (int)number : -1;
}

static double interpolated(const double* knots, int n, double x) {
  const double* values = knots + n;
  if (!(x > knots[0])) return values[0];
  if (x >= knots[n - 1]) return values[n - 1];
  int i = 0;
  while (i < n - 2 && knots[i + 1] <= x) i++;
  return values[i] + (values[i + 1] - values[i]) * ((x - knots[i]) / (knots[i + 1] - knots[i]));
}

static double of_one(int op, double a) {
  switch (op) {
    case OP_NEGATIVE: return -a;
    case OP_ABS: return fabs(a);
    case OP_SIGN: return (double)(a > 0) - (double)(a < 0);
    case OP_SIN: return sin(a);
    case OP_COS: return cos(a);
    default: return exp(a);
  }
}

static double of_two(int op, double a, double b) {
  switch (op) {
    case OP_ADD: return a + b;
    case OP_SUBTRACT: return a - b;
    case OP_MULTIPLY: return a * b;
    case OP_DIVIDE: return a / b;
    case OP_POWER: return pow(a, b);
    case OP_MIN: return a < b ? a : b;
    default: return a > b ? a : b;
  }
}

// Run a program; without inputs, only check that it is one. `finite` tells whether every result was finite.
static double run(const double* program, const Inputs* inputs, int* valid, int* finite) {
  Stack s = {{0}, 0, 1};
  *finite = 1;
  for (int at = 0; at < PROGRAM_SIZE && s.valid && *finite;) {
    int op = whole(program[at++], N_OPERATIONS - 1);
    if (op == OP_END) break;
    double value = 0;
    if (op < 0) {
      s.valid = 0;
    } else if (op == OP_NUMBER) {
      if (at < PROGRAM_SIZE) value = program[at++];
      else s.valid = 0;
    } else if (op <= OP_VOLTAGE) {
      if (inputs) value = input(inputs, op);
    } else if (op == OP_TABLE) {
      int n = at < PROGRAM_SIZE ? whole(program[at++], LARGEST_TABLE) : -1;
      double x = pop(&s);
      if (n >= 2 && at + 2 * n <= PROGRAM_SIZE) value = inputs ? interpolated(program + at, n, x) : 0;
      else s.valid = 0;
      at += 2 * (n > 0 ? n : 0);
    } else if (op <= OP_EXP) {
      value = of_one(op, pop(&s));
    } else {
      double second = pop(&s), first = pop(&s);
      value = of_two(op, first, second);
    }
    if (inputs && !isfinite(value)) *finite = 0;
    push(&s, value);
  }
  *valid = s.valid && s.depth <= 1;
  return s.depth > 0 ? s.values[0] : 0;
}

double program_value(const double program[PROGRAM_SIZE], const Inputs* inputs) {
  int valid, finite;
  double value = run(program, inputs, &valid, &finite);
  return valid && finite ? value : 0;
}

int program_is_valid(const double program[PROGRAM_SIZE]) {
  int valid, finite;
  run(program, 0, &valid, &finite);
  return valid;
}

void mecanum_evaluate(const double* program, int64_t n, const double* inputs, double* values) {
  for (int64_t i = 0; i < n; i++) {
    const double* x = inputs + 5 * i;
    values[i] = program_value(program, &(Inputs){x[0], x[1], x[2], x[3], x[4]});
  }
}
