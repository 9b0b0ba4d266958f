// Bounding volume hierarchy: items near a point, and items that a ray may hit.
#pragma once
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "bindings/array.hpp"
#include "vec.hpp"

namespace tanteo {

struct Box {
    Vec3 lo{1e300, 1e300, 1e300}, hi{-1e300, -1e300, -1e300};
    void add(const Vec3& p) {
        for (int k = 0; k < 3; ++k) {
            lo[k] = std::min(lo[k], p[k]);
            hi[k] = std::max(hi[k], p[k]);
        }
    }
    void add(const Box& b) {
        add(b.lo);
        add(b.hi);
    }
    double squared_distance(const Vec3& p) const {
        // no list of three: it would become branches that processors cannot predict
        const double x = std::max(std::max(lo.x - p.x, p.x - hi.x), 0.0);
        const double y = std::max(std::max(lo.y - p.y, p.y - hi.y), 0.0);
        const double z = std::max(std::max(lo.z - p.z, p.z - hi.z), 0.0);
        return x * x + y * y + z * z;
    }
};

class Bvh {
  public:
    struct Node {
        Box box;
        int first = 0, count = 0;  // items of a leaf; otherwise the first of two consecutive child nodes
    };
    Array<Node> nodes;
    Array<int> items;

    void build(const std::vector<Box>& boxes) {
        std::vector<Node> made;
        std::vector<int> order(boxes.size());
        std::iota(order.begin(), order.end(), 0);
        if (!boxes.empty()) {
            made.emplace_back();
            fill(boxes, made, order, 0, 0, static_cast<int>(boxes.size()), 0);
        }
        nodes = std::move(made);
        items = std::move(order);
    }

    // calls visit(item) for all items whose box is within a distance of a point, nearer child first; skips nodes for which
    // done(node) is true
    template <class Done, class Visit>
    void near(const Vec3& p, double reach, Done&& done, Visit&& visit) const {
        if (nodes.empty()) return;
        const double r2 = reach * reach;
        int stack[64], top = 0;
        if (!(nodes[0].box.squared_distance(p) > r2)) stack[top++] = 0;
        while (top) {
            const int at = stack[--top];
            if (done(at)) continue;
            const Node& node = nodes[at];
            if (node.count) {
                for (int k = 0; k < node.count; ++k) visit(items[node.first + k]);
                continue;
            }
            const double first = nodes[node.first].box.squared_distance(p);
            const double second = nodes[node.first + 1].box.squared_distance(p);
            const bool turned = second < first;
            if (!((turned ? first : second) > r2)) stack[top++] = node.first + !turned;
            if (!((turned ? second : first) > r2)) stack[top++] = node.first + turned;
        }
    }

    // calls visit(item) for the items of all leaves whose boxes, and those of their parents, are accepted
    template <class Accept, class Visit>
    void where(Accept&& accept, Visit&& visit) const {
        if (nodes.empty() || !accept(nodes[0].box)) return;
        int stack[64], top = 0;
        stack[top++] = 0;
        while (top) {
            const Node& node = nodes[stack[--top]];
            for (int k = 0; k < node.count; ++k) visit(items[node.first + k]);
            for (int k = 0; k < 2 && !node.count; ++k)
                if (accept(nodes[node.first + k].box)) stack[top++] = node.first + k;
        }
    }

    // closest(item, best) returns the squared distance of an item, or any value above best; the least one is returned
    template <class Closest>
    double closest(const Vec3& p, double best, Closest&& closest) const {
        if (nodes.empty()) return best;
        struct Entry {
            int node;
            double d2;
        } stack[64];
        int top = 0;
        stack[top++] = {0, nodes[0].box.squared_distance(p)};
        while (top) {
            const Entry at = stack[--top];
            if (at.d2 >= best) continue;
            const Node& node = nodes[at.node];
            if (node.count) {
                for (int k = 0; k < node.count; ++k) best = std::min(best, closest(items[node.first + k], best));
            } else {
                const Entry a{node.first, nodes[node.first].box.squared_distance(p)};
                const Entry b{node.first + 1, nodes[node.first + 1].box.squared_distance(p)};
                stack[top++] = a.d2 < b.d2 ? b : a;
                stack[top++] = a.d2 < b.d2 ? a : b;
            }
        }
        return best;
    }

    // hit(item, nearest) returns the range of an item along a ray, or a value above nearest; the smallest is returned.
    // A margin enlarges the boxes, so that all rays within this distance of the ray are covered.
    template <class Hit>
    double cast(const Vec3& origin, const Vec3& direction, double nearest, Hit&& hit, double margin = 0) const {
        if (nodes.empty()) return nearest;
        const Vec3 inverse{1 / direction.x, 1 / direction.y, 1 / direction.z};
        int stack[64], top = 0;
        stack[top++] = 0;
        while (top) {
            const Node& node = nodes[stack[--top]];
            double enter = 0, leave = nearest;
            for (int k = 0; k < 3; ++k) {
                const double a = (node.box.lo[k] - margin - origin[k]) * inverse[k];
                const double b = (node.box.hi[k] + margin - origin[k]) * inverse[k];
                if (a != a || b != b) continue;  // parallel to a side of the box
                enter = std::max(enter, std::min(a, b));
                leave = std::min(leave, std::max(a, b));
            }
            if (enter > leave * (1 + 1e-12) + 1e-15) continue;
            if (node.count) {
                for (int k = 0; k < node.count; ++k) nearest = std::min(nearest, hit(items[node.first + k], nearest));
            } else {
                stack[top++] = node.first + 1;
                stack[top++] = node.first;
            }
        }
        return nearest;
    }

  private:
    static constexpr int LEAF = 4;

    static void fill(const std::vector<Box>& boxes, std::vector<Node>& made, std::vector<int>& order, int at, int begin,
                     int end, int depth) {
        Box all, middles;
        for (int k = begin; k < end; ++k) {
            all.add(boxes[order[k]]);
            middles.add(0.5 * (boxes[order[k]].lo + boxes[order[k]].hi));
        }
        made[at].box = all;
        if (end - begin <= LEAF || depth > 28) {  // the stacks have 64 entries: a median split is never so deep
            made[at].first = begin;
            made[at].count = end - begin;
            return;
        }
        int axis = 0;
        const Vec3 size = middles.hi - middles.lo;
        for (int k = 1; k < 3; ++k)
            if (size[k] > size[axis]) axis = k;
        const int middle = (begin + end) / 2;
        std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end, [&](int a, int b) {
            const double p = boxes[a].lo[axis] + boxes[a].hi[axis], q = boxes[b].lo[axis] + boxes[b].hi[axis];
            return p != q ? p < q : a < b;
        });
        const int first = static_cast<int>(made.size());
        made[at].first = first;
        made.emplace_back();
        made.emplace_back();
        fill(boxes, made, order, first, begin, middle, depth + 1);
        fill(boxes, made, order, first + 1, middle, end, depth + 1);
    }
};

}  // namespace tanteo
