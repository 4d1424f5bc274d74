// The formulas of the law for one real type, CLR_LAW_REAL; law.h includes this once for each. Source: Hinkley 1969,
// Marsaglia 1965; with X = (a Z2 + b Z1) / (1 + s Z2) and
//     w = s x - a,  V = w^2 + b^2,  n = b^2 - a w,  z = x / sqrt V,  t = n / (sqrt 2 s b sqrt V):
//     f(x) = exp(-z^2/2) / sqrt(2 pi V) Q,   Q = (n/V) erf t + sqrt(2/pi) (s b / sqrt V) exp(-t^2)
//     F(x) = [x >= 0] + 2 T(z, -n / (s x b)) + 2 T(1/s, -a/b)
// f without Q is eq. (22). A point is held as x = p / q with |p| <= 1, q <= 1, so that no x overflows and the far tail,
// f ~ C / x^2, is an ordinary place. NaN stays NaN.

CLR_NAMESPACE_BEGIN

// One model in each lane, in units of its standard deviation; see clr_law.
typedef struct {
    CLR_LAW_REAL s, a, b, inverse_sd, half_turn;
} CLR_LAW_MODEL;

// n, root = sqrt V and t for (s p - a q, b q): x = p / q in units of sd.
typedef struct {
    CLR_LAW_REAL p, q, n, root, z, t;
} CLR_LAW_POINT;

CLR_FN CLR_LAW_REAL clr_at_least(CLR_LAW_REAL x, CLR_LAW_REAL least) { return x < least ? least : x; }
CLR_FN CLR_LAW_REAL clr_at_most(CLR_LAW_REAL x, CLR_LAW_REAL most) { return x > most ? most : x; }

// Divisors are kept off 0: n / 0 means t = +inf, which FAR stands for, and 0 / 0 means 0 wherever it can occur.
CLR_FN CLR_LAW_POINT clr_law_at(CLR_LAW_MODEL m, CLR_LAW_REAL p, CLR_LAW_REAL q) {
    CLR_LAW_POINT x;
    const CLR_LAW_REAL unit = clr_at_least(q, CLR_LAW_TINY);
    const CLR_LAW_REAL w = clr_fma(m.s, p, -(m.a * unit));
    const CLR_LAW_REAL bq = m.b * unit;
    x.p = p;
    x.q = q;
    x.n = clr_fma(m.b, bq, -(m.a * w));
    x.root = clr_at_least(clr_sqrt(clr_fma(w, w, bq * bq)), CLR_LAW_TINY);
    x.z = p / x.root;
    const CLR_LAW_REAL spread = CLR_LAW_K(1.4142135623730950488) * m.s * m.b * x.root;
    x.t = clr_at_most(clr_abs(x.n) / clr_at_least(spread, CLR_LAW_LEAST), CLR_LAW_FAR);
    return x;
}

CLR_FN CLR_LAW_POINT clr_law_locate(CLR_LAW_MODEL m, CLR_LAW_REAL x) {
    const CLR_LAW_REAL zero = CLR_LAW_K(0.0), one = CLR_LAW_K(1.0);
    const CLR_LAW_REAL u = x == zero ? zero : x * m.inverse_sd;
    const CLR_LAW_REAL size = clr_abs(u);
    return clr_law_at(m, size > one ? (u > zero ? one : -one) : u, size > one ? one / size : one);
}

// exp(-z^2/2) / sqrt(2 pi V): eq. (22), but for a factor q / sd.
CLR_FN CLR_LAW_REAL clr_law_gauss(CLR_LAW_POINT x) {
    return CLR_LAW_K(0.39894228040143267794) * clr_exp(CLR_LAW_K(-0.5) * x.z * x.z) / x.root;
}

// Q / q, the mean of |U| where X = x: eq. (22) lacks this factor, the Jacobian that eq. (16) forgets.
CLR_FN CLR_LAW_REAL clr_law_fold(CLR_LAW_MODEL m, CLR_LAW_POINT x) {
    const CLR_LAW_REAL mean = clr_abs(x.n) / x.root / x.root * (CLR_LAW_K(1.0) - clr_erfc(x.t));
    const CLR_LAW_REAL spread = m.s * m.b / x.root * clr_exp(-x.t * x.t);
    return clr_fma(CLR_LAW_K(0.79788456080286535588), spread, mean);
}

// f = q^2 / sd times this: it stays finite as q goes to 0.
CLR_FN CLR_LAW_REAL clr_law_density(CLR_LAW_MODEL m, CLR_LAW_POINT x) { return clr_law_gauss(x) * clr_law_fold(m, x); }

// A density of 0 stays 0 for a point mass, where 1 / sd is infinite.
CLR_FN CLR_LAW_REAL clr_law_per_sd(CLR_LAW_MODEL m, CLR_LAW_REAL density) {
    return density == CLR_LAW_K(0.0) ? density : density * m.inverse_sd;
}

CLR_FN CLR_LAW_REAL clr_law_log_per_sd(CLR_LAW_MODEL m, CLR_LAW_REAL q, CLR_LAW_REAL log_density) {
    return q == CLR_LAW_K(0.0) ? -(CLR_LAW_REAL)(INFINITY) : log_density + clr_log(m.inverse_sd);
}

CLR_FN CLR_LAW_REAL clr_law_pdf_at(CLR_LAW_MODEL m, CLR_LAW_POINT x) {
    return clr_law_per_sd(m, x.q * x.q * clr_law_density(m, x));
}

CLR_FN CLR_LAW_REAL clr_law_published_pdf_at(CLR_LAW_MODEL m, CLR_LAW_POINT x) {
    return clr_law_per_sd(m, x.q * clr_law_gauss(x));
}

CLR_FN CLR_LAW_REAL clr_law_log_gauss(CLR_LAW_POINT x) {
    return clr_fma(CLR_LAW_K(-0.5) * x.z, x.z, CLR_LAW_K(-0.91893853320467274178)) - clr_log(x.root);
}

CLR_FN CLR_LAW_REAL clr_law_log_pdf_at(CLR_LAW_MODEL m, CLR_LAW_POINT x) {
    const CLR_LAW_REAL log_q2 = CLR_LAW_K(2.0) * clr_log(x.q);
    return clr_law_log_per_sd(m, x.q, clr_law_log_gauss(x) + clr_log(clr_law_fold(m, x)) + log_q2);
}

CLR_FN CLR_LAW_REAL clr_law_published_log_pdf_at(CLR_LAW_MODEL m, CLR_LAW_POINT x) {
    return clr_law_log_per_sd(m, x.q, clr_law_log_gauss(x) + clr_log(x.q));
}

// Owen's T(h, r) for h >= 0 and 0 <= r <= 1, by Gauss-Legendre.
CLR_FN CLR_LAW_REAL clr_owens_t_inner(CLR_LAW_REAL h, CLR_LAW_REAL r) {
    const CLR_LAW_REAL one = CLR_LAW_K(1.0);
    const CLR_LAW_REAL upper = r * h > CLR_LAW_CUT ? CLR_LAW_CUT / h : r;
    const CLR_LAW_REAL minus_half_h2 = CLR_LAW_K(-0.5) * h * h;
    CLR_LAW_REAL sum = CLR_LAW_K(0.0);
    for (int i = 0; i < CLR_LAW_NODES; ++i) {
        const CLR_LAW_REAL u = upper * CLR_LAW_NODE[i];
        const CLR_LAW_REAL v = clr_fma(u, u, one);
        sum = clr_fma((CLR_LAW_REAL)(CLR_LAW_WEIGHT[i]), clr_exp(minus_half_h2 * v) / v, sum);
    }
    return CLR_LAW_K(0.15915494309189533577) * upper * sum;
}

// 2 T(h, A) for h, A >= 0, where A = above / below and hA = h A are given so that A may be infinite.
CLR_FN CLR_LAW_REAL clr_owens_t_twice(CLR_LAW_REAL h, CLR_LAW_REAL ha, CLR_LAW_REAL above, CLR_LAW_REAL below) {
    const CLR_LAW_REAL two = CLR_LAW_K(2.0), half_root = CLR_LAW_K(0.70710678118654752440);
    const CLR_LAW_REAL ratio = above > below ? below / above : above / clr_at_least(below, CLR_LAW_LEAST);
    const CLR_LAW_REAL inner = two * clr_owens_t_inner(above > below ? ha : h, ratio);
    const CLR_LAW_REAL e1 = clr_erfc(half_root * h);
    const CLR_LAW_REAL e2 = clr_erfc(half_root * ha);
    const CLR_LAW_REAL outer = CLR_LAW_K(0.5) * clr_fma(e2, CLR_LAW_K(1.0) - e1, e1);
    return above > below ? outer - inner : inner;
}

// P(X < x) for x < 0, P(X > x) for x >= 0: the tail beyond x, and never 1 minus something small.
CLR_FN CLR_LAW_REAL clr_law_tail_at(CLR_LAW_MODEL m, CLR_LAW_POINT x) {
    const CLR_LAW_REAL zero = CLR_LAW_K(0.0);
    const CLR_LAW_REAL ha = CLR_LAW_K(1.4142135623730950488) * x.t;
    const CLR_LAW_REAL size = clr_owens_t_twice(clr_abs(x.z), ha, clr_abs(x.n), m.s * m.b * clr_abs(x.p));
    const CLR_LAW_REAL turned = x.p < zero ? m.half_turn : -m.half_turn;
    return clr_at_least((x.n < zero ? -size : size) + turned, zero);
}

CLR_FN CLR_LAW_REAL clr_law_pdf(CLR_LAW_MODEL m, CLR_LAW_REAL x) { return clr_law_pdf_at(m, clr_law_locate(m, x)); }

CLR_FN CLR_LAW_REAL clr_law_log_pdf(CLR_LAW_MODEL m, CLR_LAW_REAL x) { return clr_law_log_pdf_at(m, clr_law_locate(m, x)); }

CLR_FN CLR_LAW_REAL clr_law_published_pdf(CLR_LAW_MODEL m, CLR_LAW_REAL x) {
    return clr_law_published_pdf_at(m, clr_law_locate(m, x));
}

CLR_FN CLR_LAW_REAL clr_law_published_log_pdf(CLR_LAW_MODEL m, CLR_LAW_REAL x) {
    return clr_law_published_log_pdf_at(m, clr_law_locate(m, x));
}

// Nothing lies beyond a point mass at 0, nor on it where x == 0.
CLR_FN CLR_LAW_REAL clr_law_tail(CLR_LAW_MODEL m, CLR_LAW_REAL x) {
    const CLR_LAW_REAL tail = clr_law_tail_at(m, clr_law_locate(m, x));
    const CLR_LAW_REAL none = x == x ? CLR_LAW_K(0.0) : x;
    return m.inverse_sd < (CLR_LAW_REAL)(INFINITY) ? tail : none;
}

// The side is that of x in units of sd, where the least x may round to 0.
CLR_FN CLR_LAW_REAL clr_law_cdf(CLR_LAW_MODEL m, CLR_LAW_REAL x) {
    const CLR_LAW_REAL tail = clr_law_tail(m, x);
    return x * m.inverse_sd < CLR_LAW_K(0.0) ? tail : CLR_LAW_K(1.0) - tail;
}

CLR_FN CLR_LAW_REAL clr_law_sf(CLR_LAW_MODEL m, CLR_LAW_REAL x) {
    const CLR_LAW_REAL tail = clr_law_tail(m, x);
    return x * m.inverse_sd < CLR_LAW_K(0.0) ? CLR_LAW_K(1.0) - tail : tail;
}

CLR_NAMESPACE_END
