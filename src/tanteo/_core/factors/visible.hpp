// The surfaces of a part that are visible in a wide beam: places of a quadrature over them, and their outlines.
#pragma once
#include <vector>

#include "factors/cone.hpp"

namespace tanteo {

// Where an outline crosses a scan line: rows of the places there, on the surface to the left and to the right, -1 for none;
// and the area that it sweeps to the right as the origin or the axis of the beam moves, over that of the section.
struct Outline {
    int sides[2] = {-1, -1};
    Vec3 by_origin, by_axis;
};

// Visible surfaces along scan lines (Watkins 1970). Between the heights where outlines begin, end or cross, the surfaces of
// all scan lines are the same, and their borders are straight. So a few lines and a few places on each are a Gauss quadrature
// that is smooth in the pose, also where an outline moves over the section.
class Visible {
  public:
    // Fills places, each with the fraction of the section that it represents, and outlines, only with slopes. Places of
    // outlines have no area.
    static void see(const Shape& shape, const std::vector<int>& triangles, const Vec3& origin, const Section& section,
                    bool with_slope, std::vector<RayHit>& places, std::vector<Outline>& outlines);

  private:
    // A half plane a x + b y + c >= 0 of the section: left or right of x = slope y + offset, or above or below a scan line.
    struct Side {
        double a, b, c, slope, offset;
        int bounds;  // 1: from below in x, -1: from above, 0: parallel to the scan lines
    };
    struct Facet {
        Side sides[3];
        double least, most;  // bounds of y
        Vec3 corners[3];     // depth times x and y, and depth
        Vec3 inverse_depth;  // its coefficients of x, y and 1
        Vec3 normal;
        double height;       // of the origin over the plane
        double farthest;     // largest depth
        int triangle;
    };
    // An edge between faces, or where a surface ends before others.
    struct Edge {
        double x[2], y[2];
        bool ends;
    };
    // The part of a scan line on a facet, with the sides at which it begins and ends, null for the border of the section.
    struct Span {
        double from, to;
        int facet;
        const Side *first, *last;
    };
    // A part of a scan line on which one plane is visible, with its first and last span; -1 for none.
    struct Segment {
        double from, to;
        int first, last;
    };

    const Shape* shape;
    Section section;
    double cosine = 1, sine = 0;  // of the turn of the scan lines
    std::vector<Facet> facets;
    std::vector<Edge> edges;
    std::vector<int> rows;  // facet of each triangle of the shape; -1 except while edges are found
    std::vector<double> heights;
    bool dense = false;  // whether there are more heights than are used
    std::vector<int> by_least, crossed;  // facets from the first line to the last; those that a line crosses
    size_t begun = 0;                    // number of facets that begin before it
    std::vector<Span> spans;
    std::vector<int> by_end, open;  // spans in the order of their ends; those at a place
    std::vector<Segment> segments;

    void add_facets(const std::vector<int>& triangles, const Vec3& origin);
    void add_edges();
    void turn();
    void find_sides();
    void find_heights();
    void add_height(double x, double y);
    void add_heights_at_border(const Edge& edge);
    void add_heights_of_crossings();
    bool is_inside(double x, double y, double slack) const;
    void find_spans(double y, double start, double end);
    void find_segments(double y);
    int nearest_at(double x, double y) const;
    void add_line(double y, double width, bool with_slope, std::vector<RayHit>& places, std::vector<Outline>& outlines);
    void add_outline(const Segment& left, const Segment& right, double y, double width, std::vector<RayHit>& places,
                     std::vector<Outline>& outlines) const;
    double depths_between(double from, double to) const;
    bool is_one_plane(const Facet& one, const Facet& two) const;
    double inverse_depth(int span, double x, double y) const;
    RayHit place(const Facet& facet, double x, double y, double share) const;
};

}  // namespace tanteo
