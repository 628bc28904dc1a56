#include "workspace.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>

#include "arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace oath {

namespace {
// Clearances equal to the radius count as free in spite of rounding.
constexpr double kTolerance = 1e-9;
}  // namespace

Workspace::Workspace(Box bounds, double cell) : bounds_(bounds), cell_(cell) {
    if (!(cell > 0) || !(bounds.x1 > bounds.x0) || !(bounds.y1 > bounds.y0))
        throw std::invalid_argument("bounds must have an area and the cell size must be positive");
    columns_ = static_cast<int>((bounds.x1 - bounds.x0) / cell) + 1;
    rows_ = static_cast<int>((bounds.y1 - bounds.y0) / cell) + 1;
    segment_cells_.resize(static_cast<std::size_t>(columns_) * rows_);
    solid_cells_.resize(segment_cells_.size());
}

int Workspace::column(double x) const {
    return static_cast<int>(std::clamp(std::floor((x - bounds_.x0) / cell_), 0.0, columns_ - 1.0));
}

int Workspace::row(double y) const {
    return static_cast<int>(std::clamp(std::floor((y - bounds_.y0) / cell_), 0.0, rows_ - 1.0));
}

void Workspace::check(const Kinds& kinds) const {
    if (static_cast<int>(kinds.size()) < kinds_)
        throw std::invalid_argument("kinds needs a flag for every kind of obstacle");
}

int Workspace::add_shape(Shape shape) {
    if (shape.kind < 0) throw std::invalid_argument("a kind is an index from 0");
    kinds_ = std::max(kinds_, shape.kind + 1);
    shapes_.push_back(std::move(shape));
    return static_cast<int>(shapes_.size()) - 1;
}

void Workspace::add_segment(Vec a, Vec b, double half_width, int shape) {
    const int index = static_cast<int>(segments_.size());
    segments_.push_back({a, b, half_width, shape});
    widest_ = std::max(widest_, half_width);
    const Box box = Box::of(a, b);
    const double half_cell = cell_ * 0.5000001, reach = half_cell * 1.4142136;
    for (int r = row(box.y0); r <= row(box.y1); ++r)
        for (int c = column(box.x0); c <= column(box.x1); ++c) {
            const bool border = r == 0 || c == 0 || r == rows_ - 1 || c == columns_ - 1;
            const Vec centre{bounds_.x0 + (c + 0.5) * cell_, bounds_.y0 + (r + 0.5) * cell_};
            // Border cells also hold what lies outside the bounds.
            if (border || squared_distance(centre, a, b) <= reach * reach)
                segment_cells_[static_cast<std::size_t>(r) * columns_ + c].push_back(index);
        }
}

int Workspace::add_wall(const std::vector<Vec>& ends, double half_width, int kind) {
    const int shape = add_shape({kind, true, false, {0, 0, 0, 0}, {}});
    for (std::size_t i = 0; i + 1 < ends.size(); ++i)
        add_segment(ends[i], ends[i + 1], half_width, shape);
    return shape;
}

int Workspace::add_polygon(const std::vector<Vec>& corners, int kind) {
    if (corners.size() < 3) throw std::invalid_argument("a polygon needs at least three corners");
    Box box = Box::of(corners[0], corners[0]);
    for (const Vec& p : corners)
        box = {std::min(box.x0, p.x), std::min(box.y0, p.y), std::max(box.x1, p.x),
               std::max(box.y1, p.y)};
    const int shape = add_shape({kind, true, true, box, corners});
    for (std::size_t i = 0; i < corners.size(); ++i)
        add_segment(corners[i], corners[(i + 1) % corners.size()], 0.0, shape);
    for (int r = row(box.y0); r <= row(box.y1); ++r)
        for (int c = column(box.x0); c <= column(box.x1); ++c)
            solid_cells_[static_cast<std::size_t>(r) * columns_ + c].push_back(shape);
    return shape;
}

void Workspace::remove(int shape) {
    if (shape < 0 || shape >= static_cast<int>(shapes_.size()))
        throw std::out_of_range("no such shape");
    shapes_[shape].alive = false;
}

void Workspace::set_cells(std::vector<std::uint8_t> cells, int rows, int columns,
                          double resolution, Vec origin, int kind,
                          const std::vector<Vec>& boundary) {
    cells_ = std::move(cells);
    cell_rows_ = rows, cell_columns_ = columns, cell_kind_ = kind;
    resolution_ = resolution, origin_ = origin;
    const int shape = add_shape({kind, true, false, {0, 0, 0, 0}, {}});
    segments_.reserve(segments_.size() + boundary.size() / 2);
    for (std::size_t i = 0; i + 1 < boundary.size(); i += 2)
        add_segment(boundary[i], boundary[i + 1], 0.0, shape);
}

bool Workspace::inside(Vec p, const Shape& shape) const {
    if (!shape.box.holds(p)) return false;
    bool in = false;
    const auto& c = shape.corners;
    for (std::size_t i = 0, j = c.size() - 1; i < c.size(); j = i++)
        if ((c[i].y > p.y) != (c[j].y > p.y) &&
            p.x < (c[j].x - c[i].x) * (p.y - c[i].y) / (c[j].y - c[i].y) + c[i].x)
            in = !in;
    return in;
}

bool Workspace::inside_cells(Vec p) const {
    if (cells_.empty()) return false;
    const double c = std::floor((p.x - origin_.x) / resolution_);
    const double r = std::floor((p.y - origin_.y) / resolution_);
    if (c < 0 || r < 0 || c >= cell_columns_ || r >= cell_rows_) return false;
    return cells_[static_cast<std::size_t>(r) * cell_columns_ + static_cast<std::size_t>(c)] != 0;
}

bool Workspace::inside(Vec p, const Kinds& kinds) const {
    if (!cells_.empty() && kinds[cell_kind_] && inside_cells(p)) return true;
    for (int s : solid_cells_[static_cast<std::size_t>(row(p.y)) * columns_ + column(p.x)]) {
        const Shape& shape = shapes_[s];
        if (shape.alive && kinds[shape.kind] && inside(p, shape)) return true;
    }
    return false;
}

double Workspace::clearance(Vec p, const Kinds& kinds, double limit) const {
    if (inside(p, kinds)) return 0.0;
    const int c0 = column(p.x), r0 = row(p.y);
    double best = limit;
    // Cells in ring k are at least (k - 1) cells away, so what is left cannot be nearer.
    for (int k = 0; k <= std::max(columns_, rows_); ++k) {
        if ((k - 1) * cell_ - widest_ >= best) break;
        for (int r = r0 - k; r <= r0 + k; ++r) {
            if (r < 0 || r >= rows_) continue;
            const bool full = r == r0 - k || r == r0 + k;
            for (int c = c0 - k; c <= c0 + k; c += full ? 1 : std::max(1, 2 * k)) {
                if (c < 0 || c >= columns_) continue;
                for (int i : segment_cells_[static_cast<std::size_t>(r) * columns_ + c]) {
                    const Segment& s = segments_[i];
                    const Shape& shape = shapes_[s.shape];
                    if (!shape.alive || !kinds[shape.kind]) continue;
                    const double d = std::sqrt(squared_distance(p, s.a, s.b)) - s.half_width;
                    best = std::min(best, d);
                }
            }
        }
    }
    return std::max(best, 0.0);
}

template <class Visit>
void Workspace::visit_near(Vec a, Vec b, double reach, const Kinds& kinds, Visit visit) const {
    const Box box = Box::of(a, b);
    const int first = row(box.y0 - reach), last = row(box.y1 + reach);
    const double dy = b.y - a.y;
    for (int r = first; r <= last; ++r) {
        // The part of a-b whose distance to this row of cells is at most `reach`.
        const double low = bounds_.y0 + r * cell_ - reach, high = low + cell_ + 2 * reach;
        double t0 = 0, t1 = 1;
        if (std::abs(dy) > 1e-12 && r != first && r != last) {
            t0 = std::clamp((low - a.y) / dy, 0.0, 1.0);
            t1 = std::clamp((high - a.y) / dy, 0.0, 1.0);
            if (t0 > t1) std::swap(t0, t1);
        }
        const double xa = a.x + t0 * (b.x - a.x), xb = a.x + t1 * (b.x - a.x);
        const int c1 = column(std::max(xa, xb) + reach);
        for (int c = column(std::min(xa, xb) - reach); c <= c1; ++c)
            for (int i : segment_cells_[static_cast<std::size_t>(r) * columns_ + c]) {
                const Segment& s = segments_[i];
                const Shape& shape = shapes_[s.shape];
                if (shape.alive && kinds[shape.kind] && !visit(s)) return;
            }
    }
}

bool Workspace::free(Vec a, Vec b, double radius, const Kinds& kinds) const {
    // A segment that meets no surface is inside an obstacle as a whole or not at all.
    if (inside(a, kinds)) return false;
    bool ok = true;
    visit_near(a, b, radius + widest_, kinds, [&](const Segment& s) {
        const double need = std::max(radius + s.half_width - kTolerance, 0.0);
        const double d = squared_distance(a, b, s.a, s.b);
        ok = need > 0 ? d >= need * need : d > 0;
        return ok;
    });
    return ok;
}

std::vector<int> Workspace::shapes_near(Vec a, Vec b, double radius, const Kinds& kinds) const {
    std::vector<int> found;
    auto add = [&](int shape) {
        if (std::find(found.begin(), found.end(), shape) == found.end()) found.push_back(shape);
    };
    for (int s : solid_cells_[static_cast<std::size_t>(row(a.y)) * columns_ + column(a.x)]) {
        const Shape& shape = shapes_[s];
        if (shape.alive && kinds[shape.kind] && inside(a, shape)) add(s);
    }
    visit_near(a, b, radius + widest_, kinds, [&](const Segment& s) {
        const double need = std::max(radius + s.half_width - kTolerance, 0.0);
        const double d = squared_distance(a, b, s.a, s.b);
        if (d < need * need || d == 0) add(s.shape);
        return true;
    });
    std::sort(found.begin(), found.end());
    return found;
}

}  // namespace oath

void bind_workspace(nb::module_& m) {
    using oath::Workspace;
    nb::class_<Workspace>(
        m, "Workspace",
        "Obstacles of the plane in a uniform grid: exact clearance of points and segments [m].")
        .def(
            "__init__",
            [](Workspace* self, double x0, double y0, double x1, double y1, double cell) {
                new (self) Workspace({x0, y0, x1, y1}, cell);
            },
            "x_min"_a, "y_min"_a, "x_max"_a, "y_max"_a, "cell"_a)
        .def(
            "add_wall",
            [](Workspace& self, Points ends, double half_width, int kind) {
                return self.add_wall(vectors(ends), half_width, kind);
            },
            "ends"_a, "half_width"_a, "kind"_a,
            "Add a polyline (n, 2) whose points within half_width are solid; return its index.")
        .def(
            "add_polygon",
            [](Workspace& self, Points corners, int kind) {
                return self.add_polygon(vectors(corners), kind);
            },
            "corners"_a, "kind"_a, "Add a solid polygon (n, 2); return its index.")
        .def("remove", &Workspace::remove, "shape"_a, "Take a wall or polygon out again.")
        .def(
            "set_cells",
            [](Workspace& self, Bytes2 cells, double resolution, double x, double y, int kind,
               Points boundary) {
                const std::size_t n = cells.shape(0) * cells.shape(1);
                self.set_cells({cells.data(), cells.data() + n}, static_cast<int>(cells.shape(0)),
                               static_cast<int>(cells.shape(1)), resolution, {x, y}, kind,
                               vectors(boundary));
            },
            "cells"_a, "resolution"_a, "x"_a, "y"_a, "kind"_a, "boundary"_a,
            "Add a raster (rows, columns) with its lower left corner at (x, y); boundary (2 n, 2) "
            "holds the ends of the segments between free and occupied cells.")
        .def(
            "clearance",
            [](const Workspace& self, Points points, oath::Kinds kinds, double limit) {
                self.check(kinds);
                std::vector<double> out(points.shape(0));
                {
                    nb::gil_scoped_release release;
                    for (std::size_t i = 0; i < out.size(); ++i)
                        out[i] = self.clearance(vector(points, i), kinds, limit);
                }
                return array(std::move(out));
            },
            "points"_a, "kinds"_a, "limit"_a = std::numeric_limits<double>::infinity(),
            "Distance (n,) from points (n, 2) to the nearest surface of the flagged kinds, 0 "
            "inside, at most limit.")
        .def(
            "free",
            [](const Workspace& self, Points a, Points b, double radius, oath::Kinds kinds) {
                self.check(kinds);
                same_length(a, b);
                std::vector<std::uint8_t> out(a.shape(0));
                {
                    nb::gil_scoped_release release;
                    for (std::size_t i = 0; i < out.size(); ++i)
                        out[i] = self.free(vector(a, i), vector(b, i), radius, kinds);
                }
                return array(std::move(out));
            },
            "a"_a, "b"_a, "radius"_a, "kinds"_a,
            "Whether (n,) the segments a[i]-b[i] keep the radius from all of the flagged kinds.")
        .def(
            "shapes_near",
            [](const Workspace& self, double ax, double ay, double bx, double by, double radius,
               oath::Kinds kinds) {
                self.check(kinds);
                return self.shapes_near({ax, ay}, {bx, by}, radius, kinds);
            },
            "ax"_a, "ay"_a, "bx"_a, "by"_a, "radius"_a, "kinds"_a,
            "Indices of the shapes that the segment touches or comes nearer to than the radius.");
}
