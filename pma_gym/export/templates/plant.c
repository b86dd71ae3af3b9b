/* The plant of $name.h, written by pma-gym: the arithmetic of one step, then its loop. */
#include "$name.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

$preamble
static const $name initial = {
    {$parameters},
    {$states},
    $zero, $size, 0.0
};

void ${name}_start($name *plant) { *plant = initial; }

/* Attempt one step of the rest of a call; x stays as it is where its error is too large. */
static void attempt($name *plant, const double *slope) {
    const double *p = plant->parameter;
    double *x = plant->state;
    (void)slope;
$attempt
}

void ${name}_step($name *plant, const double *first, const double *last, double duration) {
    double *command = plant->state + $command, slope[${name}_commands], jump = 0.0;
    int held = 1;
    for (int i = 0; i < ${name}_commands; i++) {
        jump = fmax(jump, fabs(first[i] - command[i]));
        held = held && first[i] == last[i];
        slope[i] = (last[i] - first[i]) / duration;
        command[i] = first[i];
    }
    if (held) {
$first_size
    }
    plant->left = duration;
    while (plant->left > 0.0) attempt(plant, slope);
    for (int i = 0; i < ${name}_commands; i++) command[i] = last[i];
}

void ${name}_read(const $name *plant, double *reading) {
    const double *p = plant->parameter, *x = plant->state;
    (void)p;
$read
}
