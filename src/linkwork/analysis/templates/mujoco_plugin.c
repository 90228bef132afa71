/* A plug-in of MuJoCo: what the links that were cut away of a mechanism with loops do to the tree
   that is left. Compile it with MuJoCo's headers and link it to MuJoCo:

     cc -O2 -shared -fPIC -I INCLUDE THIS.c -o LIBRARY libmujoco.so -lm

   It adds the links' inertia to the engine's, applies what they, springs, friction and weight take,
   and gives the motors' tendons the lengths and Jacobians of the loops. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <mujoco/mujoco.h>

@equations@
@tables@

#define CLOSED @closed@     /* gap of closed loops, in the mechanism's own units */
#define STEPS @steps@            /* of Newton's method, before the way is halved */
#define SHORTEST @shortest@    /* part of the way from one configuration to the next */
#define PIVOT @pivot@         /* least relative pivot of a configuration that is not singular */

typedef struct {
  int x_at[X], dof_at[N], tendon_at[M + 1];
  int count, place[N * N], pair[N * N];   /* where the inertia goes to, and comes from */
  mjtNum left[N * N];                     /* inertia as it was left */
  int known;                              /* whether it was left */
  double x[X], start[X], there[X], q[Q], tried[Q], next[Q], v[N];
  double inertia[N * N], bias[N], A[N * M + 1], length[M + 1], rate[M + 1];
} Leg;

static int failed(const char* what, const char* name) {
  mju_warning("@name@: the model has no %s '%s' as the tree needs it", what, name);
  return -1;
}

/* Find joints, tendons and entries of the inertia in the model. */
static int find(const mjModel* m, Leg* leg) {
  int x = 0, n = 0;
  for (int k = 0; k < JOINTS; k++) {
    int id = mj_name2id(m, mjOBJ_JOINT, JOINT[k]);
    if (id < 0) return failed("joint", JOINT[k]);
    for (int i = 0; i < (FREE[k] ? 7 : 1); i++) leg->x_at[x++] = m->jnt_qposadr[id] + i;
    for (int i = 0; i < (FREE[k] ? 6 : 1); i++) leg->dof_at[n++] = m->jnt_dofadr[id] + i;
  }
  for (int k = 0; k < M; k++) {
    leg->tendon_at[k] = mj_name2id(m, mjOBJ_TENDON, MOTOR[k]);
    if (leg->tendon_at[k] < 0) return failed("tendon", MOTOR[k]);
  }
  leg->count = 0;
  for (int i = 0; i < N; i++) {
    for (int j = 0; j <= i; j++) {
      int found = 0;
      for (int turn = 0; turn < 2 && !found; turn++) {
        int row = leg->dof_at[turn ? j : i], column = leg->dof_at[turn ? i : j];
        for (int at = m->M_rowadr[row]; at < m->M_rowadr[row] + m->M_rownnz[row]; at++) {
          if (m->M_colind[at] != column) continue;
          leg->place[leg->count] = at;
          leg->pair[leg->count++] = j * N + i;
          found = 1;
        }
      }
      if (!found && COUPLED[j * N + i]) return failed("inertia that couples joints with", JOINT[0]);
    }
  }
  return 0;
}

static int init(const mjModel* m, mjData* d, int instance) {
  Leg* leg = (Leg*)calloc(1, sizeof(Leg));
  if (!leg || find(m, leg)) {
    free(leg);
    return -1;
  }
  d->plugin_data[instance] = (uintptr_t)leg;
  return 0;
}

static void destroy(mjData* d, int instance) {
  free((void*)d->plugin_data[instance]);
  d->plugin_data[instance] = 0;
}

/* The state of an instance: x and q where it was last. */
static int nstate(const mjModel* m, int instance) {
  (void)m, (void)instance;
  return X + Q;
}

static void reset(const mjModel* m, mjtNum* state, void* data, int instance) {
  (void)m, (void)instance;
  memcpy(state, HOME, sizeof(double) * (X + Q));
  if (data) ((Leg*)data)->known = 0;
}

static void copy(mjData* to, const mjModel* m, const mjData* from, int instance) {
  (void)m;
  Leg* leg = (Leg*)to->plugin_data[instance];
  if (leg) memcpy(leg, (const Leg*)from->plugin_data[instance], sizeof(Leg));
}

/* Close the loops from leg->tried on at its joints. */
static int newton(Leg* leg) {
  double gap, pivot;
  for (int k = 0; k < STEPS; k++) {
    lw_closing_code(leg->tried, leg->next, &gap, &pivot);
    if (gap < CLOSED) return pivot > PIVOT;
    memcpy(leg->tried, leg->next, sizeof leg->tried);
  }
  return 0;
}

/* Lead leg->q from one configuration to leg->x, in parts of the way where one is too much. */
static int lead(Leg* leg, const mjtNum* from) {
  double way = 0, step = 1;
  memcpy(leg->start, from, sizeof leg->start);
  memcpy(leg->q, from + X, sizeof leg->q);
  while (way < 1) {
    double to = way + step;
    for (int i = 0; i < X; i++)
      leg->there[i] = to < 1 ? leg->start[i] + to * (leg->x[i] - leg->start[i]) : leg->x[i];
    lw_placed_code(leg->q, leg->there, leg->tried);
    if (newton(leg)) {
      memcpy(leg->q, leg->tried, sizeof leg->q);
      way = to;
      step = 2 * step < 1 - way ? 2 * step : 1 - way;
    } else if ((step /= 2) < SHORTEST) {
      return 0;
    }
  }
  return 1;
}

/* Add the inertia, unless the engine's still is as it was left: then its stage of positions was
   left out. */
static void add_inertia(const mjModel* m, mjData* d, Leg* leg) {
  int same = leg->known;
  for (int k = 0; k < leg->count && same; k++) same = d->M[leg->place[k]] == leg->left[k];
  if (same) return;
  for (int k = 0; k < leg->count; k++) d->M[leg->place[k]] += leg->inertia[leg->pair[k]];
  mj_factorM(m, d);
  if (mj_isDual(m)) mj_projectConstraint(m, d);
  for (int k = 0; k < leg->count; k++) leg->left[k] = d->M[leg->place[k]];
  leg->known = 1;
}

/* Give the tendons and the actuators on them lengths, rates and Jacobians. */
static void move_motors(const mjModel* m, mjData* d, Leg* leg) {
  for (int k = 0; k < M; k++) {
    int id = leg->tendon_at[k];
    d->ten_length[id] = leg->length[k];
    d->ten_velocity[id] = leg->rate[k];
    for (int at = m->ten_J_rowadr[id]; at < m->ten_J_rowadr[id] + m->ten_J_rownnz[id]; at++)
      for (int j = 0; j < N; j++)
        if (m->ten_J_colind[at] == leg->dof_at[j]) d->ten_J[at] = leg->A[j * M + k];
  }
  if (M) mj_transmission(m, d);
  for (int i = 0; i < m->nactuator; i++)
    for (int k = 0; k < M; k++)
      if (m->actuator_trntype[i] == mjTRN_TENDON && m->actuator_trnid[2 * i] == leg->tendon_at[k])
        d->actuator_velocity[m->actuator_outadr[i]] =
            m->actuator_gear[6 * m->actuator_outadr[i]] * leg->rate[k];
}

static void compute(const mjModel* m, mjData* d, int instance, int capability) {
  (void)capability;
  Leg* leg = (Leg*)d->plugin_data[instance];
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (int i = 0; i < X; i++) leg->x[i] = d->qpos[leg->x_at[i]];
  for (int i = 0; i < N; i++) leg->v[i] = d->qvel[leg->dof_at[i]];
  if (!lead(leg, state) && !lead(leg, HOME)) {
    for (int i = 0; i < N; i++) d->qfrc_passive[leg->dof_at[i]] = NAN;
    return;
  }
  memcpy(state, leg->x, sizeof leg->x);
  memcpy(state + X, leg->q, sizeof leg->q);
  lw_added_code(leg->q, leg->v, leg->inertia, leg->bias, leg->A, leg->length, leg->rate);
  add_inertia(m, d, leg);
  for (int i = 0; i < N; i++) d->qfrc_passive[leg->dof_at[i]] -= leg->bias[i];
  move_motors(m, d, leg);
}

mjPLUGIN_LIB_INIT(linkwork_tree) {
  mjpPlugin plugin;
  if (mjp_getPlugin("@name@", NULL)) return;   /* the same, for the name tells plug-ins apart */
  mjp_defaultPlugin(&plugin);
  plugin.name = "@name@";
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = nstate;
  plugin.init = init;
  plugin.destroy = destroy;
  plugin.copy = copy;
  plugin.reset = reset;
  plugin.compute = compute;
  mjp_registerPlugin(&plugin);
}
