/* The network of $name.h, written by pma-gym: float weights, sums in double. */
#include "$name.h"

#include <math.h>

$weights

static void layer(const float *weight, const float *bias, int inputs, int outputs,
                  const double *values, double *sums) {
    for (int i = 0; i < outputs; i++) {
        sums[i] = bias[i];
        for (int j = 0; j < inputs; j++) sums[i] += (double)weight[i * inputs + j] * values[j];
    }
}

double ${name}_act(const double *observation) {
    double values[$widest], sums[$widest];
    for (int i = 0; i < ${name}_observations; i++) values[i] = $scaled;
$layers
    return sums[0];
}

double ${name}_volts(double action, double before, double base) {
    double voltage;
    (void)before, (void)base;
$volts
    return voltage;
}
