/* $about

   x(t+1) = A x(t) + B (u(t) - u0), y(t) - y0 = C x(t) + D (u(t) - u0), one step every $dt s.
   C99; no memory is allocated, nothing is static but the constant matrices.

$channels */
#ifndef ${NAME}_H
#define ${NAME}_H

enum { ${NAME}_STATES = $states, ${NAME}_INPUTS = $inputs, ${NAME}_OUTPUTS = $outputs };
#define ${NAME}_DT $dt

typedef struct {
  double x[$room_x];  /* state */
  double u0[$room_u]; /* inputs at the operating point */
  double y0[$room_y]; /* outputs at the operating point */
} ${name}_model;

/* Rest at the operating point that the model was identified about. */
void ${name}_start(${name}_model *model);

/* Outputs y(t) for the inputs u(t). */
void ${name}_output(const ${name}_model *model, const double u[], double y[]);

/* From x(t) to x(t+1) with the inputs u(t). */
void ${name}_step(${name}_model *model, const double u[]);

#endif
