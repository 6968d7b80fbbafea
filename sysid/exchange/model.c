#include "$name.h"

static const double A[] = {$A};
static const double B[] = {$B};
static const double C[] = {$C};
static const double D[] = {$D};
static const ${name}_model START = {{$x0}, {$u0}, {$y0}};

/* out = M x + N (u - u0), one row at a time */
static void rows(int count, const double M[], const double N[], const ${name}_model *model, const double u[],
                 double out[]) {
  for (int i = 0; i < count; i++) {
    out[i] = 0.0;
    for (int j = 0; j < ${NAME}_STATES; j++) out[i] += M[i * ${NAME}_STATES + j] * model->x[j];
    for (int j = 0; j < ${NAME}_INPUTS; j++) out[i] += N[i * ${NAME}_INPUTS + j] * (u[j] - model->u0[j]);
  }
}

void ${name}_start(${name}_model *model) { *model = START; }

void ${name}_output(const ${name}_model *model, const double u[], double y[]) {
  rows(${NAME}_OUTPUTS, C, D, model, u, y);
  for (int i = 0; i < ${NAME}_OUTPUTS; i++) y[i] += model->y0[i];
}

void ${name}_step(${name}_model *model, const double u[]) {
  double next[$room_x];
  rows(${NAME}_STATES, A, B, model, u, next);
  for (int i = 0; i < ${NAME}_STATES; i++) model->x[i] = next[i];
}
