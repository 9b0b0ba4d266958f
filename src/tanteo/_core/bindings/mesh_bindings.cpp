// Bindings of meshes before they are shapes: connectivity, coarser copies.
#include <memory>

#include "bindings/conversion.hpp"
#include "shape/simplify.hpp"
#include "shape/topology.hpp"

namespace tanteo {

namespace {

// Triangles of a coarser copy and their original triangles.
nb::tuple simplified(Doubles vertices, Ints triangles, Ints faces, double tolerance, double tilt) {
    const std::vector<Vec3> points = vectors(vertices, "vertices");
    const size_t count = faces.size();
    expect(triangles, "triangles", 3 * count, 0, static_cast<int64_t>(points.size()) - 1);
    expect(tolerance, "tolerance", 0, 1e9);
    expect(tilt, "tilt", 0, 1.5);
    std::vector<int> kept, rows;
    {
        nb::gil_scoped_release release;
        Simplifier mesh(points, triangles.data(), faces.data(), count);
        mesh.simplify(tolerance, tilt);
        kept.swap(mesh.triangles);
        rows.swap(mesh.rows);
    }
    const size_t left = rows.size();
    return nb::make_tuple(array_of(std::move(kept), {left, 3}), list_of(std::move(rows)));
}

constexpr size_t MOST = 4'000'000'000;  // rows are 32-bit numbers during the sort

nb::tuple key_sets(Starts keys) {
    if (keys.size() > MOST) refuse("keys", "expected less than 4e9");
    std::vector<int64_t> first, sets;
    {
        nb::gil_scoped_release release;
        KeySets found(keys.data(), keys.size());
        first.swap(found.first);
        sets.swap(found.sets);
    }
    return nb::make_tuple(list_of(std::move(first)), list_of(std::move(sets)));
}

void expect_rows(const Starts& a, const char* name, size_t count) {  // from 0 to below a count
    for (size_t k = 0; k < a.size(); ++k)
        if (a.data()[k] < 0 || a.data()[k] >= static_cast<int64_t>(count))
            refuse(name, "expected numbers from 0 to below " + std::to_string(count));
}

nb::tuple edge_table(Starts triangles, size_t vertices) {
    if (triangles.size() % 3) refuse("triangles", "expected three corners each");
    expect_rows(triangles, "triangles", vertices);
    std::unique_ptr<EdgeTable> table;
    {
        nb::gil_scoped_release release;
        table = std::make_unique<EdgeTable>(triangles.data(), triangles.size() / 3, vertices);
    }
    const size_t count = table->ahead.size();
    return nb::make_tuple(array_of(std::move(table->ends), {count, 2}), list_of(std::move(table->ahead)),
                          list_of(std::move(table->back)), list_of(std::move(table->left)),
                          list_of(std::move(table->right)));
}

nb::ndarray<nb::numpy, int64_t> connected(size_t count, Starts first, Starts second) {
    if (first.size() != second.size()) refuse("second", "expected as many nodes as in first");
    expect_rows(first, "first", count);
    expect_rows(second, "second", count);
    return list_of(components(count, first.data(), second.data(), first.size()));
}

nb::ndarray<nb::numpy, int64_t> near(Doubles points, double distance) {
    const size_t count = expect(points, "points", {ANY, 3});
    std::vector<int64_t> pairs;
    {
        nb::gil_scoped_release release;
        pairs = near_pairs(points.data(), count, distance);
    }
    const size_t found = pairs.size() / 2;
    return array_of(std::move(pairs), {found, 2});
}

nb::ndarray<nb::numpy, double> angles(Doubles normals, Starts left, Starts right) {
    const size_t known = expect(normals, "normals", {ANY, 3}), count = left.size();
    if (right.size() != count) refuse("right", "expected as many rows as in left");
    expect_rows(left, "left", known);
    expect_rows(right, "right", known);
    std::vector<double> out(count);
    angles_between(normals.data(), left.data(), right.data(), count, out.data());
    return list_of(std::move(out));
}

nb::ndarray<nb::numpy, double> longest(Doubles vertices, Starts triangles) {
    const size_t known = expect(vertices, "vertices", {ANY, 3}), count = triangles.size() / 3;
    if (triangles.size() % 3) refuse("triangles", "expected three corners each");
    expect_rows(triangles, "triangles", known);
    std::vector<double> out(count);
    longest_sides(vertices.data(), triangles.data(), count, out.data());
    return list_of(std::move(out));
}

nb::tuple middles(Doubles vertices, Starts triangles, Doubles origin) {
    const size_t known = expect(vertices, "vertices", {ANY, 3}), count = triangles.size() / 3;
    if (triangles.size() % 3) refuse("triangles", "expected three corners each");
    expect_rows(triangles, "triangles", known);
    expect(origin, "origin", {3});
    std::vector<double> all(3 * count), volumes(count);
    middles_and_volumes(vertices.data(), triangles.data(), count, origin.data(), all.data(), volumes.data());
    return nb::make_tuple(array_of(std::move(all), {count, 3}), list_of(std::move(volumes)));
}

template <class Corners>
nb::tuple weld(Corners corners) {
    const size_t count = corners.size() / 3;
    if (corners.size() % 3 || count > (size_t(1) << 31)) refuse("corners", "expected less than 2e9 rows of three numbers");
    std::vector<double> vertices;
    std::vector<int64_t> index;
    {
        nb::gil_scoped_release release;
        index = welded(corners.data(), count, vertices);
    }
    const size_t known = vertices.size() / 3;
    return nb::make_tuple(array_of(std::move(vertices), {known, 3}), list_of(std::move(index)));
}

nb::tuple normals_and_areas(Doubles vertices, Starts triangles) {
    const size_t known = expect(vertices, "vertices", {ANY, 3}), count = triangles.size() / 3;
    if (triangles.size() % 3) refuse("triangles", "expected three corners each");
    expect_rows(triangles, "triangles", known);
    std::vector<double> normals(3 * count), areas(count);
    {
        nb::gil_scoped_release release;
        triangle_geometry(vertices.data(), triangles.data(), count, normals.data(), areas.data());
    }
    return nb::make_tuple(array_of(std::move(normals), {count, 3}), list_of(std::move(areas)));
}

}  // namespace

void offer_meshes(nb::module_& m) {
    using namespace nb::literals;
    m.def("angles_between", &angles, "normals"_a, "left"_a, "right"_a);
    m.def("components", &connected, "count"_a, "first"_a, "second"_a);
    m.def("edge_table", &edge_table, "triangles"_a, "vertices"_a);
    m.def("key_sets", &key_sets, "keys"_a);
    m.def("longest_sides", &longest, "vertices"_a, "triangles"_a);
    m.def("middles_and_volumes", &middles, "vertices"_a, "triangles"_a, "origin"_a);
    m.def("near_pairs", &near, "points"_a, "distance"_a);
    m.def("simplify", &simplified, "vertices"_a, "triangles"_a, "faces"_a, "tolerance"_a, "tilt"_a);
    m.def("triangle_geometry", &normals_and_areas, "vertices"_a, "triangles"_a);
    m.def("weld", &weld<Floats>, "corners"_a);
    m.def("weld", &weld<Doubles>, "corners"_a);
}

}  // namespace tanteo
