"""The language of formulas: what Python makes of the same text, and nothing else; tables; their programs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.wheel_drive.formula import compile_formula
from mecanum_env.wheel_drive.program import (
    CODES,
    INPUTS,
    PROGRAM_SIZE,
    evaluate,
    inputs_of,
    joined,
    table_program,
)

PYTHON = {
    "abs": abs, "sign": lambda x: float((x > 0) - (x < 0)), "sin": math.sin, "cos": math.cos, "exp": math.exp,
    "min": min, "max": max,
}  # fmt: skip


def formulas(depth: int = 3) -> st.SearchStrategy[str]:
    """Return random formulas of numbers from -9 to 9, short enough for a program."""
    leaf = st.one_of(st.sampled_from(INPUTS), st.integers(0, 90).map(lambda n: f"{n / 10:.1f}"))
    if depth == 0:
        return leaf
    part = formulas(depth - 1)
    return st.one_of(
        leaf,
        part.map(lambda a: f"-({a})"),
        st.tuples(st.sampled_from(("abs", "sign", "sin", "cos", "exp")), part).map(
            lambda t: f"{t[0]}({t[1]})"
        ),
        st.tuples(st.sampled_from(("min", "max")), part, part).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
        st.tuples(part, st.sampled_from("+-*/"), part).map(lambda t: f"({t[0]}) {t[1]} ({t[2]})"),
        part.map(lambda a: f"({a}) ** 2.0"),
    )


inputs = st.fixed_dictionaries({name: st.floats(-9.0, 9.0) for name in INPUTS})


@given(text=formulas(), values=inputs)
def test_a_formula_is_what_python_makes_of_it(text, values):
    try:
        expected = float(eval(text, {"__builtins__": {}}, {**PYTHON, **values}))
    except (ZeroDivisionError, OverflowError):
        expected = 0.0
    found = evaluate(compile_formula(text), values)
    # A part without a finite value, which Python may pass over (as the unused end of a minimum), gives 0.
    assert found == expected or found == 0.0
    assert math.isfinite(found)


@given(text=formulas(), rows=st.lists(inputs, min_size=1, max_size=5))
def test_arrays_give_what_single_numbers_give(text, rows):
    program = compile_formula(text)
    columns = {name: np.array([row[name] for row in rows]) for name in INPUTS}
    np.testing.assert_array_equal(evaluate(program, columns), [float(evaluate(program, row)) for row in rows])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2 ** 3 ** 2", 512.0),
        ("-2 ** 2", -4.0),
        ("(-2) ** 2", 4.0),
        ("+speed - -1", 4.0),
        ("min(5, speed, 4)", 3.0),
        ("-0.08 * speed * sin(3 * angle)", -0.24 * math.sin(6.0)),
        ("1e2 + .5", 100.5),
    ],
)
def test_precedence_and_spelling(text, value):
    assert evaluate(compile_formula(text), {"speed": 3.0, "angle": 2.0}) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize(
    "text", ["1 / speed", "exp(1000)", "(-1) ** 0.5", "10 ** 10 ** 10 ** 10", "sin(1 / speed)"]
)
def test_what_has_no_finite_value_counts_as_zero(text):
    assert evaluate(compile_formula(text), {}) == 0.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a formula"),
        ("speed +", "not a formula"),
        ("spede", "unknown name spede .did you mean .speed."),
        ("sqrt(speed)", "unknown function sqrt"),
        ("sin(1, 2)", "sin takes one number"),
        ("max(1)", "max takes two numbers or more"),
        ("sin", "unknown name sin"),
        ("speed.real", "speed.real is not part of the language"),
        ("speed if 1 else 2", "not part of the language"),
        ("1if 2else 3", "not a formula"),
        ("__import__('os')", "unknown character"),
        ("exp(*speed)", "not part of the language"),
        ("1j", "1j is no number"),
        ("True", "True is no number"),
        ("1e999", "beyond double precision"),
        ("9" * 350, "beyond double precision"),
        ("(" * 20000 + "1" + ")" * 20000, "too long, it has 40001 characters"),
        ("-" * 300 + "1", "nested too deep"),
        ("+".join(["speed"] * 40), f"too long, it takes 79 instructions of at most {PROGRAM_SIZE}"),
        ("speed+(" * 20 + "1" + ")" * 20, "wait for each other"),
    ],
)
def test_anything_else_is_refused_in_one_sentence(text, message):
    with pytest.raises(InputError, match=message) as caught:
        compile_formula(text)
    assert len(str(caught.value)) < 300


def test_a_table_is_linear_in_between_and_held_outside():
    program = table_program("speed", (-10.0, 0.0, 20.0), (1.0, 2.0, -2.0))
    found = evaluate(program, {"speed": [-50.0, -10.0, -5.0, 0.0, 5.0, 20.0, 21.0]})
    np.testing.assert_allclose(found, [1.0, 1.0, 1.5, 2.0, 1.0, -2.0, -2.0])


def test_joined_programs_give_the_sum():
    both = joined([compile_formula("speed + 1"), table_program("time", (0.0, 1.0), (0.0, 10.0))])
    assert evaluate(both, {"speed": 2.0, "time": 0.5}) == 8.0
    assert joined([]) == ()
    assert inputs_of(both) == {"speed", "time"}


@pytest.mark.parametrize(
    "numbers",
    [(99.0,), (0.5,), (math.nan,), (CODES["+"],), (CODES["number"],), (CODES["speed"], CODES["speed"]),
     (CODES["speed"], CODES["table"], 3.0, 1.0), (CODES["speed"], CODES["table"], 1.0, 1.0, 1.0)],
)  # fmt: skip
def test_other_rows_of_numbers_are_no_programs(numbers):
    with pytest.raises(InputError, match="is no program"):
        evaluate(numbers, {})
