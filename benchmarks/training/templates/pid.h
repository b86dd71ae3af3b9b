/* PID of pma-gym for $station at $pressure kPa, exported; SI and volts.
 *
 * Call ${name}_reset, then ${name}_act every $period s with the position that was measured and the
 * reference $ahead s ahead of the call's time.
 */
#ifndef ${name}_h
#define ${name}_h

typedef struct {
    double integral, derivative, error;
    int begun;
} ${name}_state;

void ${name}_reset(${name}_state *state);

/* Voltage (V) of the $actuator to hold until the next call; positions in $unit. */
double ${name}_act(${name}_state *state, double reference, double position);

#endif
