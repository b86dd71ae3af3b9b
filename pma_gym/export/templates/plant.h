/* $title
 *
 * The plant of the model "$model", exported by pma-gym. SI throughout.
 *
 * Integrator: that of pma_gym's Plant.simulate, exponential Rosenbrock steps of adaptive size, held
 * to parameter[0] of the states' scales. Steps end where the motion turns (stick and slip), where a
 * cable or a muscle tightens, and close to where another law changes form. Commands are linear in
 * time within a call. Memory is the struct alone. Compile as C99 with -ffp-contract=off and -lm.
 */
#ifndef ${name}_h
#define ${name}_h

enum { /* parameter[] */
$parameters
    ${name}_parameters
};

enum { /* state[] */
$states
    ${name}_states
};

enum { /* commands of ${name}_step */
$commands
    ${name}_commands
};

enum { /* readings of ${name}_read: of the sensors, without noise, then true values */
$readings
    ${name}_readings
};

typedef struct {
    double parameter[${name}_parameters];
    double state[${name}_states];
    double zero_contraction; /* contraction without load where the trial began (m) */
    double size, left;       /* of the integrator: next step, time to go (s) */
} $name;

/* The model's parameters, and its state settled at the commands of the export. */
void ${name}_start($name *plant);

/* Go on for a duration (s) under commands from first to last; twice the same holds them. A state
 * that is no number afterwards says that the integration failed. */
void ${name}_step($name *plant, const double *first, const double *last, double duration);

void ${name}_read(const $name *plant, double *reading);

#endif
