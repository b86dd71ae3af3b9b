/* $title, exported by pma-gym.
 *
 * Entries of the observation, and what 1.0 stands for; all are held in -1 to 1:
$observation
 */
#ifndef ${name}_h
#define ${name}_h

enum { ${name}_observations = $inputs };

/* The action, -1 to 1. */
double ${name}_act(const double *observation);

/* Voltage (V, 0-10) that an action asks for.
 *
 * before: voltage commanded last; base: that of the controller below ($base). */
double ${name}_volts(double action, double before, double base);

#endif
