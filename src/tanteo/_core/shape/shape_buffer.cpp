// Serialization of a shape to bytes, and a shape that reads such bytes in place. The byte order is that of the machine.
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "shape/shape.hpp"

namespace tanteo {

namespace {

constexpr uint64_t VERSION = 6;  // of the contents of a shape and its construction: raise it whenever either changes
constexpr size_t ALIGNED = 64, MOST_ARRAYS = 32;

struct Head {
    char magic[8] = {'t', 'a', 'n', 't', 'e', 'o', 'S', '\n'};
    uint64_t version = VERSION, layout = 0, size = 0, sum = 0;  // sum: checksum of all bytes
    ShapeNumbers numbers;
    struct {
        uint64_t begin, count;
    } arrays[MOST_ARRAYS] = {};
};
static_assert(sizeof(Head) % 8 == 0);

// Any single word that differs changes the sum, because every step is invertible.
uint64_t sum_of(const unsigned char* bytes, size_t size) {
    uint64_t h = 0x9e3779b97f4a7c15u;
    for (size_t k = 0; k < size; k += 8) {
        uint64_t word;
        std::memcpy(&word, bytes + k, 8);
        h = (h ^ word) * 0xff51afd7ed558ccdu;
        h ^= h >> 32;
    }
    return h;
}

uint64_t sum_of(const Head& head, const unsigned char* bytes) {
    unsigned char known[sizeof(Head)];
    std::memcpy(known, &head, sizeof(Head));
    std::memset(known + offsetof(Head, sum), 0, sizeof(head.sum));
    return sum_of(known, sizeof(Head)) ^ sum_of(bytes + sizeof(Head), head.size - sizeof(Head));
}

size_t aligned(size_t at) { return (at + ALIGNED - 1) / ALIGNED * ALIGNED; }

void refuse(const char* why) {
    throw std::invalid_argument(std::string("buffer: expected a shape as Shape.bytes() wrote it, got ") + why + ".");
}

}  // namespace

template <class Self, class Visit>
void Shape::each_array(Self& s, Visit&& visit) {
    visit(s.vertices), visit(s.triangles), visit(s.faces), visit(s.flat_of), visit(s.normals), visit(s.profiles);
    visit(s.flats), visit(s.places), visit(s.outlines), visit(s.bin_start), visit(s.bin_edges);
    visit(s.convex_edges), visit(s.edges), visit(s.axes), visit(s.face_round), visit(s.corners), visit(s.hull), visit(s.face_area), visit(s.samples), visit(s.sample_normals);
    visit(s.triangle_tree.nodes), visit(s.triangle_tree.items), visit(s.flat_tree.nodes), visit(s.flat_tree.items);
    visit(s.edge_tree.nodes), visit(s.edge_tree.items), visit(s.grid), visit(s.grid_triangle);
}

size_t Shape::size() const {
    size_t at = aligned(sizeof(Head));
    each_array(*this, [&](const auto& array) { at = aligned(at + array.size() * sizeof(array[0])); });
    return at;
}

void Shape::write(unsigned char* out) const {
    Head head;
    head.numbers = *this;
    size_t at = aligned(sizeof(Head)), k = 0;
    each_array(*this, [&](const auto& array) {
        head.arrays[k++] = {at, array.size()};
        head.layout = 31 * head.layout + sizeof(array[0]);
        at = aligned(at + array.size() * sizeof(array[0]));
    });
    head.size = at;
    std::memset(out, 0, at);
    k = 0;
    each_array(*this, [&](const auto& array) {
        if (!array.empty()) std::memcpy(out + head.arrays[k].begin, array.data(), array.size() * sizeof(array[0]));
        ++k;
    });
    head.sum = sum_of(head, out);
    std::memcpy(out, &head, sizeof(Head));
}

Shape::Shape(const unsigned char* bytes, size_t size) {
    Head head, own;
    if (size < sizeof(Head)) refuse("too few bytes");
    std::memcpy(&head, bytes, sizeof(Head));
    if (std::memcmp(head.magic, own.magic, sizeof(own.magic)) != 0) refuse("other data");
    if (head.version != VERSION) refuse("that of another version");
    if (head.size != size || size % 8 != 0) refuse("an incomplete one");
    if (reinterpret_cast<uintptr_t>(bytes) % 8 != 0) refuse("one at an unaligned address");
    if (head.sum != sum_of(head, bytes)) refuse("one that is damaged");
    static_cast<ShapeNumbers&>(*this) = head.numbers;
    uint64_t layout = 0;
    size_t k = 0;
    each_array(*this, [&](auto& array) {
        using T = std::remove_const_t<std::remove_reference_t<decltype(array[0])>>;
        layout = 31 * layout + sizeof(T);
        const auto [begin, count] = head.arrays[k++];
        if (begin > size || count > (size - begin) / sizeof(T)) refuse("one that is damaged");
        array = Array<T>(reinterpret_cast<const T*>(bytes + begin), count);
    });
    if (layout != head.layout) refuse("that of another machine");
}

}  // namespace tanteo
