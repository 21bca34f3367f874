/*
 * The number type of the ECU and its functions: single precision, or double with -DECU_DOUBLE.
 *
 * The comparisons below choose as Python's min() and max() do: of two equal values, and of a pair with a value that is
 * not a number, the first.
 */
#ifndef REAL_H
#define REAL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#ifdef ECU_DOUBLE
typedef double real_t;
#define REAL_OF(name) name
#define REAL_INFINITY ((real_t)HUGE_VAL)
#else
typedef float real_t;
#define REAL_OF(name) name##f
#define REAL_INFINITY ((real_t)HUGE_VALF)
#endif
#define REAL_NAN ((real_t)NAN)

/* Numbers of one machine: a bench sets those of one after the other without compiling for each, a tool those of its own. */
#ifdef ECU_SETTABLE
#define OF_MACHINE
#else
#define OF_MACHINE const
#endif

/* A constant: written in full, rounded to the type by the compiler. */
#ifdef ECU_PERTURBED
#define R(number) ((real_t)(float)(number)) /* a double build with the constants of the single one, for tests */
#define SAMPLED(number) ((real_t)(float)(number)) /* and with its samples: they decide by themselves, and are the same each time */
#else
#define R(number) ((real_t)(number))
#define SAMPLED(number) (number)
#endif

#define real_sin(x) REAL_OF(sin)(x)
#define real_cos(x) REAL_OF(cos)(x)
#define real_tan(x) REAL_OF(tan)(x)
#define real_asin(x) REAL_OF(asin)(x)
#define real_acos(x) REAL_OF(acos)(x)
#define real_atan(x) REAL_OF(atan)(x)
#define real_atan2(y, x) REAL_OF(atan2)((y), (x))
#define real_exp(x) REAL_OF(exp)(x)
#define real_log(x) REAL_OF(log)(x)
#define real_sqrt(x) REAL_OF(sqrt)(x)
#define real_hypot(x, y) REAL_OF(hypot)((x), (y))
#define real_copysign(x, sign) REAL_OF(copysign)((x), (sign))
#define real_pow(x, exponent) REAL_OF(pow)((x), (exponent))
#define real_ldexp(x, power) REAL_OF(ldexp)((x), (int)(power))
#define real_rint(x) REAL_OF(rint)(x)

static inline real_t real_abs(real_t x)
{
    return REAL_OF(fabs)(x);
}

static inline real_t real_min(real_t a, real_t b)
{
    return (b < a) ? b : a;
}

static inline real_t real_max(real_t a, real_t b)
{
    return (b > a) ? b : a;
}

/* Towards zero, as Python's int(). */
static inline int32_t real_whole(real_t x)
{
    return (int32_t)x;
}

/* A truth as Python counts it. */
static inline int32_t real_counted(bool truth)
{
    return truth ? 1 : 0;
}

static inline bool real_is_finite(real_t x)
{
    /* a difference with itself is 0 of every finite value, and of no other */
    return (x - x) == R(0.0);
}

#endif
