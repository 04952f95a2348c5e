/* The IDM rollout of the calibration in C, as little as it can be: Euler with the old speed behind a known leader, no
 * search for another one. Built by test_kernel_benchmark.py; the equations are those of idm_sumo/models/idm.py. */
#include <math.h>

#define DT 0.1
#define LANES 8

static inline double larger(double a, double b) { return a > b ? a : b; }

static inline double acceleration(
    double v, double rate, double gap, double a, double weight, double headway, double d0, double d1, double inverse)
{
    double ratio = v * inverse;
    double wanted = d0 + d1 * sqrt(larger(ratio, 0.0)) + larger(0.0, headway * v + v * rate * weight);
    double interaction = wanted / larger(gap, 0.01);
    double free = larger(a * (1.0 - ratio * ratio * ratio * ratio - interaction * interaction), -9.0);
    return gap > 0.01 ? free : -9.0;
}

/* Mean distance from the recorded vehicle for every parameter set of every driver.
 * theta: n x m x 5 (a, b, T, d0, d1); forward, target, lateral: n x h; rear, leader: n x (h + 1); costs: n x m. */
void costs(
    long n, long m, long h, const double *theta, const double *start_x, const double *start_speed,
    const double *desired_speed, const double *forward, const double *target, const double *lateral,
    const double *rear, const double *leader, double *costs)
{
    for (long i = 0; i < n; i++)
        for (long first = 0; first < m; first += LANES) {
            double x[LANES], v[LANES], total[LANES] = {0};
            double a[LANES], weight[LANES], headway[LANES], d0[LANES], d1[LANES], inverse = 1.0 / desired_speed[i];
            for (int j = 0; j < LANES; j++) {
                const double *one = theta + 5 * (i * m + (first + j < m ? first + j : m - 1));
                a[j] = one[0], weight[j] = 1.0 / (2.0 * sqrt(one[0] * one[1]));
                headway[j] = one[2], d0[j] = one[3], d1[j] = one[4];
                x[j] = start_x[i], v[j] = start_speed[i];
            }
            for (long k = 0; k < h; k++) {
                double behind = rear[i * (h + 1) + k], ahead = leader[i * (h + 1) + k];
                double step = forward[i * h + k] * DT, at = target[i * h + k], off = lateral[i * h + k];
                for (int j = 0; j < LANES; j++) {
                    double acc = acceleration(
                        v[j], v[j] - ahead, behind - x[j], a[j], weight[j], headway[j], d0[j], d1[j], inverse);
                    x[j] += v[j] * step;
                    v[j] = larger(0.0, v[j] + acc * DT);
                    total[j] += sqrt((x[j] - at) * (x[j] - at) + off * off);
                }
            }
            for (int j = 0; j < LANES && first + j < m; j++) costs[i * m + first + j] = total[j] / h;
        }
}

/* One rollout a driver; theta: n x 5; x, v: n x (h + 1), filled. */
void drive(
    long n, long h, const double *theta, const double *start_x, const double *start_speed,
    const double *desired_speed, const double *forward, const double *rear, const double *leader, double *x, double *v)
{
    for (long i = 0; i < n; i++) {
        const double *one = theta + 5 * i, *behind = rear + i * (h + 1), *ahead = leader + i * (h + 1);
        double *at = x + i * (h + 1), *speed = v + i * (h + 1);
        double weight = 1.0 / (2.0 * sqrt(one[0] * one[1])), inverse = 1.0 / desired_speed[i];
        at[0] = start_x[i], speed[0] = start_speed[i];
        for (long k = 0; k < h; k++) {
            double acc = acceleration(speed[k], speed[k] - ahead[k], behind[k] - at[k], one[0], weight,
                                      one[2], one[3], one[4], inverse);
            at[k + 1] = at[k] + speed[k] * forward[i * h + k] * DT;
            speed[k + 1] = larger(0.0, speed[k] + acc * DT);
        }
    }
}
