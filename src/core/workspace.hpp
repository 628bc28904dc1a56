// Obstacles of the plane in a uniform grid: exact clearance of points and segments.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "geometry.hpp"

namespace oath {

// Which kinds of obstacle count: one flag per kind.
using Kinds = std::vector<std::uint8_t>;

class Workspace {
public:
    // `cell` is the grid's cell size [m]; it decides speed, never a result.
    Workspace(Box bounds, double cell);

    // Both return the shape's index. A wall is everything within `half_width` of its segments.
    int add_wall(const std::vector<Vec>& ends, double half_width, int kind);
    int add_polygon(const std::vector<Vec>& corners, int kind);
    void remove(int shape);

    // Cells of a raster; only its boundary enters the index, the inside is looked up.
    void set_cells(std::vector<std::uint8_t> cells, int rows, int columns, double resolution,
                   Vec origin, int kind, const std::vector<Vec>& boundary);

    // Throws unless there is a flag for every kind in use.
    void check(const Kinds& kinds) const;

    // Distance to the nearest surface, 0 inside an obstacle, at most `limit`.
    double clearance(Vec p, const Kinds& kinds, double limit) const;

    // Whether the whole segment keeps `radius` from every obstacle.
    bool free(Vec a, Vec b, double radius, const Kinds& kinds) const;

    // Indices of the shapes of these kinds that hold p, or come closer to the segment than radius.
    std::vector<int> shapes_near(Vec a, Vec b, double radius, const Kinds& kinds) const;

private:
    struct Segment {
        Vec a, b;
        double half_width;
        int shape;
    };
    struct Shape {
        int kind;
        bool alive;
        bool solid;  // a polygon, whose inside counts
        Box box;
        std::vector<Vec> corners;
    };

    int column(double x) const;
    int row(double y) const;
    bool inside(Vec p, const Kinds& kinds) const;
    bool inside(Vec p, const Shape& shape) const;
    bool inside_cells(Vec p) const;
    int add_shape(Shape shape);
    void add_segment(Vec a, Vec b, double half_width, int shape);
    // Calls visit(segment) for the counted segments whose cells the inflated segment a-b meets,
    // until visit returns false.
    template <class Visit>
    void visit_near(Vec a, Vec b, double reach, const Kinds& kinds, Visit visit) const;

    Box bounds_;
    double cell_;
    int columns_, rows_;
    int kinds_ = 0;      // one more than the largest kind
    double widest_ = 0;  // largest half width of any segment
    std::vector<Segment> segments_;
    std::vector<Shape> shapes_;
    std::vector<std::vector<int>> segment_cells_;
    std::vector<std::vector<int>> solid_cells_;

    std::vector<std::uint8_t> cells_;
    int cell_rows_ = 0, cell_columns_ = 0, cell_kind_ = 0;
    double resolution_ = 1;
    Vec origin_{0, 0};
};

}  // namespace oath
