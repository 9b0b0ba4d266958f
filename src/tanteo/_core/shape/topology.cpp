#include "shape/topology.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <utility>

namespace tanteo {

KeySets::KeySets(const int64_t* keys, size_t count) : sets(count) {
    constexpr int BITS = 11, PASSES = 6;  // a radix sort, which keeps the order of equal keys
    constexpr size_t BUCKETS = size_t(1) << BITS;
    struct Item {
        uint64_t key;
        uint32_t row;
    };
    if (!count) return;
    const int64_t least = *std::min_element(keys, keys + count);
    std::vector<Item> items(count), sorted(count);
    std::vector<std::array<size_t, BUCKETS>> counts(PASSES);
    for (auto& some : counts) some.fill(0);
    for (size_t k = 0; k < count; ++k) {
        const uint64_t key = static_cast<uint64_t>(keys[k]) - static_cast<uint64_t>(least);
        items[k] = {key, static_cast<uint32_t>(k)};
        for (int p = 0; p < PASSES; ++p) ++counts[p][(key >> (BITS * p)) & (BUCKETS - 1)];
    }
    for (int p = 0; p < PASSES; ++p) {
        const int shift = BITS * p;
        auto& starts = counts[p];
        if (starts[(items[0].key >> shift) & (BUCKETS - 1)] == count) continue;  // all keys have this digit
        size_t total = 0;
        for (size_t& start : starts) total += std::exchange(start, total);
        for (const Item& item : items) sorted[starts[(item.key >> shift) & (BUCKETS - 1)]++] = item;
        items.swap(sorted);
    }
    for (size_t k = 0; k < count; ++k) {
        if (!k || items[k].key != items[k - 1].key) first.push_back(items[k].row);
        sets[items[k].row] = static_cast<int64_t>(first.size()) - 1;
    }
}

EdgeTable::EdgeTable(const int64_t* triangles, size_t count, size_t vertices) {
    struct Side {
        int64_t high, triangle;  // triangle: of a side from the higher vertex to the lower one its complement
    };
    std::vector<size_t> start(vertices + 1, 0);
    const auto each = [&](auto&& visit) {
        for (size_t t = 0; t < count; ++t)
            for (int j = 0; j < 3; ++j) visit(triangles[3 * t + j], triangles[3 * t + (j + 1) % 3], static_cast<int64_t>(t));
    };
    each([&](int64_t a, int64_t b, int64_t) { ++start[std::min(a, b) + 1]; });
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<Side> sides(3 * count);
    {
        std::vector<size_t> at(start.begin(), start.end() - 1);
        each([&](int64_t a, int64_t b, int64_t t) { sides[at[std::min(a, b)]++] = {std::max(a, b), a < b ? t : ~t}; });
    }
    const size_t expected = 3 * count / 2 + 16;
    for (auto* all : {&ahead, &back, &left, &right}) all->reserve(expected);
    ends.reserve(2 * expected);
    for (size_t v = 0; v < vertices; ++v) {
        const auto begin = sides.begin() + start[v], end = sides.begin() + start[v + 1];
        std::sort(begin, end, [](const Side& p, const Side& q) {
            return p.high != q.high ? p.high < q.high : p.triangle < q.triangle;
        });
        for (auto side = begin; side != end; ++side) {
            if (side == begin || side->high != side[-1].high) {
                ends.push_back(static_cast<int64_t>(v));
                ends.push_back(side->high);
                for (auto* all : {&ahead, &back}) all->push_back(0);
                for (auto* all : {&left, &right}) all->push_back(-1);
            }
            const bool forward = side->triangle >= 0;
            ++(forward ? ahead : back).back();
            int64_t& last = (forward ? left : right).back();
            last = std::max(last, forward ? side->triangle : ~side->triangle);
        }
    }
}

std::vector<int64_t> components(size_t count, const int64_t* first, const int64_t* second, size_t links) {
    std::vector<int64_t> root(count);
    std::iota(root.begin(), root.end(), 0);
    const auto find = [&](int64_t k) {
        while (root[k] != k) k = root[k] = root[root[k]];
        return k;
    };
    for (size_t k = 0; k < links; ++k) {
        const int64_t a = find(first[k]), b = find(second[k]);
        root[std::max(a, b)] = std::min(a, b);
    }
    int64_t labels = 0;
    for (size_t k = 0; k < count; ++k) {  // a root is the lowest node of its component
        const int64_t lowest = root[k];
        root[k] = lowest == static_cast<int64_t>(k) ? labels++ : root[lowest];
    }
    return root;
}

std::vector<int64_t> near_pairs(const double* points, size_t count, double distance) {
    std::vector<int64_t> out;
    if (!count || !(distance > 0)) return out;
    double lo[3], size = 0;
    for (int k = 0; k < 3; ++k) {
        double hi = lo[k] = points[k];
        for (size_t i = 1; i < count; ++i) {
            lo[k] = std::min(lo[k], points[3 * i + k]);
            hi = std::max(hi, points[3 * i + k]);
        }
        size = std::max(size, hi - lo[k]);
    }
    const double step = std::max(4 * distance, size / 1e6);  // few points are so near to a cell's side that two cells count
    std::vector<int64_t> keys;
    std::vector<int64_t> owners;
    for (size_t i = 0; i < count; ++i) {
        int64_t least[3], most[3];
        for (int k = 0; k < 3; ++k) {
            const double at = points[3 * i + k] - lo[k];
            least[k] = static_cast<int64_t>(std::floor((at - distance) / step)) + 1;
            most[k] = static_cast<int64_t>(std::floor((at + distance) / step)) + 1;
        }
        for (int64_t x = least[0]; x <= most[0]; ++x)
            for (int64_t y = least[1]; y <= most[1]; ++y)
                for (int64_t z = least[2]; z <= most[2]; ++z) {
                    keys.push_back((x << 42) | (y << 21) | z);
                    owners.push_back(static_cast<int64_t>(i));
                }
    }
    const KeySets cells(keys.data(), keys.size());
    std::vector<int64_t> start(cells.first.size() + 1, 0), members(keys.size());
    for (const int64_t cell : cells.sets) ++start[cell + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<int64_t> at(start.begin(), start.end() - 1);
    for (size_t k = 0; k < keys.size(); ++k) members[at[cells.sets[k]]++] = owners[k];
    for (size_t cell = 0; cell + 1 < start.size(); ++cell)
        for (int64_t i = start[cell]; i < start[cell + 1]; ++i)
            for (int64_t j = i + 1; j < start[cell + 1]; ++j) {
                const double* p = points + 3 * members[i];
                const double* q = points + 3 * members[j];
                if (squared(load(p) - load(q)) <= distance * distance) {
                    out.push_back(members[i]);
                    out.push_back(members[j]);
                }
            }
    return out;
}

template <class Number, class Bits>
std::vector<int64_t> welded(const Number* rows, size_t count, std::vector<double>& different) {
    struct Key {
        Bits x, y, z;
    };
    size_t slots = 16;
    while (slots < count) slots *= 2;  // a closed mesh has a vertex for six corners
    std::vector<int32_t> table(slots, -1);
    std::vector<Key> keys;
    std::vector<int64_t> out(count);
    const auto hash = [](const Key& k) {
        uint64_t h = k.x * 0x9E3779B97F4A7C15ull ^ (k.y + 0x7F4A7C15ull) * 0xC2B2AE3D27D4EB4Full ^ k.z * 0x165667B19E3779F9ull;
        h ^= h >> 29;
        return (h * 0xBF58476D1CE4E5B9ull) >> 20;
    };
    const auto rehash = [&] {
        slots *= 2;
        table.assign(slots, -1);
        for (size_t k = 0; k < keys.size(); ++k) {
            size_t slot = hash(keys[k]) & (slots - 1);
            while (table[slot] >= 0) slot = (slot + 1) & (slots - 1);
            table[slot] = static_cast<int32_t>(k);
        }
    };
    for (size_t i = 0; i < count; ++i) {
        Number row[3];
        for (int k = 0; k < 3; ++k) row[k] = rows[3 * i + k] + Number(0);
        Key key;
        std::memcpy(&key, row, sizeof key);
        size_t slot = hash(key) & (slots - 1);
        while (table[slot] >= 0) {
            const Key& known = keys[table[slot]];
            if (known.x == key.x && known.y == key.y && known.z == key.z) break;
            slot = (slot + 1) & (slots - 1);
        }
        if (table[slot] < 0) {
            table[slot] = static_cast<int32_t>(keys.size());
            keys.push_back(key);
            for (const Number x : row) different.push_back(x);
        }
        out[i] = table[slot];
        if (2 * keys.size() > slots) rehash();
    }
    return out;
}

std::vector<int64_t> welded(const float* rows, size_t count, std::vector<double>& different) {
    return welded<float, uint32_t>(rows, count, different);
}

std::vector<int64_t> welded(const double* rows, size_t count, std::vector<double>& different) {
    return welded<double, uint64_t>(rows, count, different);
}

void triangle_geometry(const double* vertices, const int64_t* triangles, size_t count, double* normals, double* areas) {
    for (size_t t = 0; t < count; ++t) {
        const Vec3 a = load(vertices + 3 * triangles[3 * t]);
        const Vec3 across = cross(load(vertices + 3 * triangles[3 * t + 1]) - a, load(vertices + 3 * triangles[3 * t + 2]) - a);
        const double doubled = norm(across);
        areas[t] = doubled / 2;
        for (int k = 0; k < 3; ++k) normals[3 * t + k] = doubled > 0 ? across[k] / doubled : 0;
    }
}

void angles_between(const double* normals, const int64_t* left, const int64_t* right, size_t count, double* angles) {
    for (size_t k = 0; k < count; ++k) {
        const Vec3 a = load(normals + 3 * left[k]), b = load(normals + 3 * right[k]);
        angles[k] = std::atan2(norm(cross(a, b)), dot(a, b));
    }
}

void longest_sides(const double* vertices, const int64_t* triangles, size_t count, double* lengths) {
    for (size_t t = 0; t < count; ++t) {
        Vec3 p[3];
        for (int j = 0; j < 3; ++j) p[j] = load(vertices + 3 * triangles[3 * t + j]);
        lengths[t] = std::sqrt(std::max({squared(p[1] - p[0]), squared(p[2] - p[1]), squared(p[0] - p[2])}));
    }
}

void middles_and_volumes(const double* vertices, const int64_t* triangles, size_t count, const double* origin,
                         double* middles, double* volumes) {
    const Vec3 from = load(origin);
    for (size_t t = 0; t < count; ++t) {
        Vec3 p[3];
        for (int j = 0; j < 3; ++j) p[j] = load(vertices + 3 * triangles[3 * t + j]);
        for (int k = 0; k < 3; ++k) middles[3 * t + k] = (p[0][k] + p[1][k] + p[2][k]) / 3;
        volumes[t] = dot(p[0] - from, cross(p[1] - from, p[2] - from)) / 6;
    }
}

}  // namespace tanteo
