// Distances between points and segments in the plane [m].
#pragma once

#include <algorithm>
#include <cmath>

namespace oath {

struct Vec {
    double x, y;
};

struct Box {
    double x0, y0, x1, y1;

    static Box of(Vec a, Vec b) {
        return {std::min(a.x, b.x), std::min(a.y, b.y), std::max(a.x, b.x), std::max(a.y, b.y)};
    }
    bool holds(Vec p) const { return p.x >= x0 && p.x <= x1 && p.y >= y0 && p.y <= y1; }
};

inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y}; }
inline double cross(Vec a, Vec b) { return a.x * b.y - a.y * b.x; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y; }
inline double squared(Vec a) { return dot(a, a); }
inline double distance(Vec a, Vec b) { return std::sqrt(squared(a - b)); }

// Squared distance from p to the segment a-b.
inline double squared_distance(Vec p, Vec a, Vec b) {
    const Vec along = b - a;
    const double length = squared(along);
    const double t = length > 0 ? std::clamp(dot(p - a, along) / length, 0.0, 1.0) : 0.0;
    return squared(Vec{a.x + t * along.x, a.y + t * along.y} - p);
}

// Squared distance between the segments a-b and c-d; 0 when they cross. Touching and collinear
// segments need no case of their own: then an end lies on the other segment.
inline double squared_distance(Vec a, Vec b, Vec c, Vec d) {
    const bool apart_1 = (cross(b - a, c - a) > 0) == (cross(b - a, d - a) > 0);
    const bool apart_2 = (cross(d - c, a - c) > 0) == (cross(d - c, b - c) > 0);
    if (!apart_1 && !apart_2) return 0.0;
    return std::min(std::min(squared_distance(a, c, d), squared_distance(b, c, d)),
                    std::min(squared_distance(c, a, b), squared_distance(d, a, b)));
}

}  // namespace oath
