// The physical limit: the package's integrator written by hand, for the benchmark alone.
//
// A load on an elastic rope that cannot push, hung from a pulley whose path is given as a quintic for each control
// step, on a drum that follows its commanded speed within limits of speed and acceleration: the equations of
// aframe_env/dynamics/{load,winch,step}.py, RK4, and nothing else (no sea, no lag, no limit
// switches, no parting rope). Rows in blocks of LANES, structure of arrays within a block.

#include <cmath>
#include <cstddef>

// Calls that are not inlined would keep the loop over lanes from being vectorised.
#define INLINE inline __attribute__((always_inline))

namespace {

constexpr int LANES = 64;

// The order in which limit/library.py names them.
enum Slot {
    LOAD_POSITION,
    LOAD_VELOCITY = LOAD_POSITION + 3,
    DRUM_ANGLE = LOAD_VELOCITY + 3,
    DRUM_SPEED,
    OMEGA1,
    OMEGA2,
    PEAK_TENSION,
    MASS,
    GRAVITY,
    TARGET,
    AXIAL_STIFFNESS,
    ROPE_DAMPING,
    FREE_LENGTH,
    DRUM_TO_PULLEY,
    DRUM_RADIUS,
    MAX_SPEED,
    MAX_ACCELERATION,
    PATH,  // coefficients 0..5 of the pulley's x, then y, then z
    SLOTS = PATH + 18
};

template <typename Real>
struct Vector {
    Real x, y, z;
};

template <typename Real>
INLINE Vector<Real> along(Vector<Real> a, Real h, Vector<Real> b) {
    return {a.x + h * b.x, a.y + h * b.y, a.z + h * b.z};
}

template <typename Real>
INLINE Vector<Real> weighted(Vector<Real> a, Vector<Real> b, Vector<Real> c, Vector<Real> d) {
    return {a.x + 2 * (b.x + c.x) + d.x, a.y + 2 * (b.y + c.y) + d.y, a.z + 2 * (b.z + c.z) + d.z};
}

template <typename Real>
INLINE Real greater(Real a, Real b) {
    return a > b ? a : b;
}

template <typename Real>
struct Pulley {
    Vector<Real> position, velocity;
};

template <typename Real>
struct Rope {
    Real length, rate, stiffness;  // unstretched, between drum and load; N/m
};

template <typename Real>
struct Parameters {
    Real inverse_mass, gravity, damping, to_pulley;
};

template <typename Real>
struct Pull {
    Real force;  // negative where the rope is slack
    Vector<Real> towards;
    Real nearness;
};

template <typename Real>
INLINE Pull<Real> rope_pull(Vector<Real> x, Vector<Real> v, const Pulley<Real>& pulley, const Rope<Real>& rope,
                            const Parameters<Real>& p) {
    const Vector<Real> u = along(pulley.position, Real(-1), x);
    const Vector<Real> du = along(pulley.velocity, Real(-1), v);
    const Real square = u.x * u.x + u.y * u.y + u.z * u.z + Real(1e-18);
    const Real inverse = Real(1) / std::sqrt(square);
    const Real rate = (u.x * du.x + u.y * du.y + u.z * du.z) * inverse;
    const Real pull = rope.stiffness * (square * inverse + p.to_pulley - rope.length) + p.damping * (rate - rope.rate);
    return {pull, u, inverse};
}

template <typename Real>
INLINE Vector<Real> acceleration(Real force, const Pull<Real>& pull, const Parameters<Real>& p) {
    const Real share = force * pull.nearness * p.inverse_mass;
    return {share * pull.towards.x, share * pull.towards.y, share * pull.towards.z - p.gravity};
}

template <typename Real>
INLINE Real taut(Real pull) {
    return pull > Real(0) ? pull : Real(0);
}

// The tension of the last stage; where the rope goes slack or comes taut within the step, the one by which the weights
// find the impulse of the taut part, the pull on a parabola.
template <typename Real>
INLINE Real last_tension(Real pull1, Real pull2, Real pull3, Real pull4) {
    const Real most = pull1 > pull4 ? pull1 : pull4, least = pull1 > pull4 ? pull4 : pull1;
    const bool corner = most * least < Real(0);
    const Real share = most / (corner ? most - least : Real(1));
    const Real bend = Real(2) * (pull1 + pull4 - pull2 - pull3);
    const Real impulse = taut(share * (bend * share * (share / Real(3) - Real(0.5)) + Real(0.5) * most));
    const Real earlier = Real(2) * (taut(pull2) + taut(pull3)) + taut(pull1);
    return corner ? Real(6) * impulse - earlier : taut(pull4);
}

template <typename Real>
INLINE void on_quintic(const Real* path, int axis, int j, Real t, Real& position, Real& velocity) {
    const Real* c = path + 6 * axis * LANES + j;
    const Real c0 = c[0], c1 = c[LANES], c2 = c[2 * LANES], c3 = c[3 * LANES], c4 = c[4 * LANES], c5 = c[5 * LANES];
    // Horner's scheme for the polynomial and its derivative at once.
    Real p = c5, d = c5;
    p = c4 + t * p;
    d = p + t * d;
    p = c3 + t * p;
    d = p + t * d;
    p = c2 + t * p;
    d = p + t * d;
    p = c1 + t * p;
    d = p + t * d;
    position = c0 + t * p;
    velocity = d;
}

template <typename Real>
INLINE Pulley<Real> pulley_at(const Real* path, int j, Real t) {
    Pulley<Real> s;
    on_quintic(path, 0, j, t, s.position.x, s.velocity.x);
    on_quintic(path, 1, j, t, s.position.y, s.velocity.y);
    on_quintic(path, 2, j, t, s.position.z, s.velocity.z);
    return s;
}

template <typename Real>
struct Drum {
    Real angle, speed;
};

// A ramp at the greatest acceleration onto the command, and its exact integral.
template <typename Real>
INLINE Drum<Real> drum_at(Real t, Drum<Real> start, Real command, Real slope, Real ramp_time) {
    const Real ramp = t < ramp_time ? t : ramp_time;
    const Real speed = start.speed + slope * ramp;
    return {start.angle + ramp * (start.speed + Real(0.5) * slope * ramp) + command * (t - ramp),
            t < ramp_time ? speed : command};
}

template <typename Real>
INLINE Rope<Real> rope_on(Drum<Real> drum, Real free_length, Real radius, Real axial_stiffness) {
    const Real length = free_length + radius * drum.angle;
    return {length, radius * drum.speed, axial_stiffness / length};
}

template <typename Real>
void control_step(Real* __restrict row, const Real* __restrict commands, int substeps, Real period) {
    // The plan of the winch, and what the end of an inner step hands to the next.
    Real command[LANES], slope[LANES], ramp_time[LANES], angle0[LANES], speed0[LANES];
    Real length[LANES], rate[LANES], stiffness[LANES], tip[6][LANES], inverse_mass[LANES];
#pragma GCC ivdep
    for (int j = 0; j < LANES; ++j) {
        const Real limit = row[MAX_SPEED * LANES + j];
        const Real wanted = commands[j];
        command[j] = wanted > limit ? limit : (wanted < -limit ? -limit : wanted);
        const Real gap = command[j] - row[DRUM_SPEED * LANES + j];
        slope[j] = gap < 0 ? -row[MAX_ACCELERATION * LANES + j] : row[MAX_ACCELERATION * LANES + j];
        ramp_time[j] = gap / slope[j];
        angle0[j] = row[DRUM_ANGLE * LANES + j];
        speed0[j] = row[DRUM_SPEED * LANES + j];
        row[PEAK_TENSION * LANES + j] = 0;
        inverse_mass[j] = Real(1) / row[MASS * LANES + j];
        const Rope<Real> rope = rope_on(Drum<Real>{angle0[j], speed0[j]}, row[FREE_LENGTH * LANES + j],
                                        row[DRUM_RADIUS * LANES + j], row[AXIAL_STIFFNESS * LANES + j]);
        length[j] = rope.length;
        rate[j] = rope.rate;
        stiffness[j] = rope.stiffness;
        const Pulley<Real> s = pulley_at(row + PATH * LANES, j, Real(0));
        tip[0][j] = s.position.x;
        tip[1][j] = s.position.y;
        tip[2][j] = s.position.z;
        tip[3][j] = s.velocity.x;
        tip[4][j] = s.velocity.y;
        tip[5][j] = s.velocity.z;
    }
    const Real h = period / Real(substeps), half = Real(0.5) * h, sixth = h / Real(6);
    for (int index = 0; index < substeps; ++index) {
        const Real middle = (Real(index) + Real(0.5)) * h, end = Real(index + 1) * h;
#pragma GCC ivdep
        for (int j = 0; j < LANES; ++j) {
            const Parameters<Real> p{inverse_mass[j], row[GRAVITY * LANES + j],
                                     row[ROPE_DAMPING * LANES + j], row[DRUM_TO_PULLEY * LANES + j]};
            const Real free_length = row[FREE_LENGTH * LANES + j], radius = row[DRUM_RADIUS * LANES + j];
            const Real axial_stiffness = row[AXIAL_STIFFNESS * LANES + j];
            const Drum<Real> start{angle0[j], speed0[j]};
            const Drum<Real> drum2 = drum_at(middle, start, command[j], slope[j], ramp_time[j]);
            const Drum<Real> drum3 = drum_at(end, start, command[j], slope[j], ramp_time[j]);
            const Rope<Real> rope1{length[j], rate[j], stiffness[j]};
            Rope<Real> rope2 = rope_on(drum2, free_length, radius, axial_stiffness);
            const Rope<Real> rope3 = rope_on(drum3, free_length, radius, axial_stiffness);
            // The speed from which Simpson's rule finds the drum's turn, though a ramp end inside the step.
            rope2.rate = Real(1.5) / h * (rope3.length - length[j]) - Real(0.25) * (rate[j] + rope3.rate);
            const Pulley<Real> s1{{tip[0][j], tip[1][j], tip[2][j]}, {tip[3][j], tip[4][j], tip[5][j]}};
            const Pulley<Real> s2 = pulley_at(row + PATH * LANES, j, middle);
            const Pulley<Real> s3 = pulley_at(row + PATH * LANES, j, end);
            const Vector<Real> x1{row[LOAD_POSITION * LANES + j], row[(LOAD_POSITION + 1) * LANES + j],
                                  row[(LOAD_POSITION + 2) * LANES + j]};
            const Vector<Real> v1{row[LOAD_VELOCITY * LANES + j], row[(LOAD_VELOCITY + 1) * LANES + j],
                                  row[(LOAD_VELOCITY + 2) * LANES + j]};
            const Pull<Real> pull1 = rope_pull(x1, v1, s1, rope1, p);
            const Vector<Real> a1 = acceleration(taut(pull1.force), pull1, p);
            const Vector<Real> x2 = along(x1, half, v1), v2 = along(v1, half, a1);
            const Pull<Real> pull2 = rope_pull(x2, v2, s2, rope2, p);
            const Vector<Real> a2 = acceleration(taut(pull2.force), pull2, p);
            const Vector<Real> x3 = along(x1, half, v2), v3 = along(v1, half, a2);
            const Pull<Real> pull3 = rope_pull(x3, v3, s2, rope2, p);
            const Vector<Real> a3 = acceleration(taut(pull3.force), pull3, p);
            const Vector<Real> x4 = along(x1, h, v3), v4 = along(v1, h, a3);
            const Pull<Real> pull4 = rope_pull(x4, v4, s3, rope3, p);
            const Real last = last_tension(pull1.force, pull2.force, pull3.force, pull4.force);
            const Vector<Real> a4 = acceleration(last, pull4, p);
            const Vector<Real> x = along(x1, sixth, weighted(v1, v2, v3, v4));
            const Vector<Real> v = along(v1, sixth, weighted(a1, a2, a3, a4));
            row[LOAD_POSITION * LANES + j] = x.x;
            row[(LOAD_POSITION + 1) * LANES + j] = x.y;
            row[(LOAD_POSITION + 2) * LANES + j] = x.z;
            row[LOAD_VELOCITY * LANES + j] = v.x;
            row[(LOAD_VELOCITY + 1) * LANES + j] = v.y;
            row[(LOAD_VELOCITY + 2) * LANES + j] = v.z;
            const Real target = row[TARGET * LANES + j];
            const Real e1 = x1.z - target, e2 = x2.z - target, e3 = x3.z - target, e4 = x4.z - target;
            row[OMEGA1 * LANES + j] += sixth * (e1 * e1 + 2 * (e2 * e2 + e3 * e3) + e4 * e4);
            row[OMEGA2 * LANES + j] = greater(std::fabs(x.z - target), row[OMEGA2 * LANES + j]);
            row[PEAK_TENSION * LANES + j] =
                greater(greater(greater(pull1.force, pull2.force), greater(pull3.force, pull4.force)),
                        row[PEAK_TENSION * LANES + j]);
            row[DRUM_ANGLE * LANES + j] = drum3.angle;
            row[DRUM_SPEED * LANES + j] = drum3.speed;
            length[j] = rope3.length;
            rate[j] = rope3.rate;
            stiffness[j] = rope3.stiffness;
            tip[0][j] = s3.position.x;
            tip[1][j] = s3.position.y;
            tip[2][j] = s3.position.z;
            tip[3][j] = s3.velocity.x;
            tip[4][j] = s3.velocity.y;
            tip[5][j] = s3.velocity.z;
        }
    }
}

template <typename Real>
void advance(Real* blocks, const Real* commands, long count, int substeps, double period, int threads) {
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long block = 0; block < count; ++block)
        control_step(blocks + static_cast<std::size_t>(block) * SLOTS * LANES, commands + block * LANES, substeps,
                     static_cast<Real>(period));
}

}  // namespace

extern "C" {

int limit_lanes() { return LANES; }
int limit_slots() { return SLOTS; }

// blocks: (count, SLOTS, LANES), commands: (count, LANES) rad/s; one control step of `period` s.
void limit_step_double(double* blocks, const double* commands, long count, int substeps, double period, int threads) {
    advance(blocks, commands, count, substeps, period, threads);
}
void limit_step_float(float* blocks, const float* commands, long count, int substeps, double period, int threads) {
    advance(blocks, commands, count, substeps, period, threads);
}
}
