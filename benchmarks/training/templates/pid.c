/* The law of $name.h, written by pma-gym. Compile as C99 with -ffp-contract=off and -lm. */
#include "$name.h"

#include <math.h>

void ${name}_reset(${name}_state *state) { *state = (${name}_state){0.0, 0.0, 0.0, 0}; }

double ${name}_act(${name}_state *state, double reference, double position) {
    const double error = reference - position, change = state->begun ? error - state->error : 0.0;
    double voltage;
$law
    state->error = error;
    state->begun = 1;
    return voltage;
}
