#include "segmentation/intake/repeated_planes.hpp"

#include <algorithm>

#include "segmentation/intake/named_planes.hpp"

namespace emmetrope::segmentation {
namespace {

/// Voxels plane by plane along an axis.
class Planes {
 public:
  Planes(const Stack& stack, int axis) : stack_(stack), axis_(axis) {}

  bool are_same(int a, int b) const {
    return all_of([&](int u, int v) { return at(a, u, v) == at(b, u, v); });
  }
  bool shows_something(int plane) const {
    return !all_of([&](int u, int v) { return at(plane, u, v) == at(plane, 0, 0); });
  }

 private:
  template <typename Predicate>
  bool all_of(const Predicate& holds) const {
    const int width = axis_ == 0 ? stack_.rows : stack_.columns,
              height = axis_ == 2 ? stack_.rows : stack_.slices();
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u)
        if (!holds(u, v)) return false;
    return true;
  }
  float at(int plane, int u, int v) const {
    return axis_ == 0 ? stack_.at(plane, u, v) : axis_ == 1 ? stack_.at(u, plane, v) : stack_.at(u, v, plane);
  }

  const Stack& stack_;
  int axis_;
};

/// Voxels that are repeated to enlarge a volume to whatever size are so at distances that differ by one plane at most.
/// \param repeats  ascending
/// \param first, last  planes that show something
bool are_even(const std::vector<int>& repeats, int first, int last) {
  constexpr std::size_t fewest = 4;  // chosen: copies of some planes may lie evenly by chance
  if (repeats.size() < fewest) return false;
  int shortest = repeats[1] - repeats[0], longest = std::max(repeats.front() - first, last - repeats.back());
  for (std::size_t i = 1; i < repeats.size(); ++i) {
    shortest = std::min(shortest, repeats[i] - repeats[i - 1]);
    longest = std::max(longest, repeats[i] - repeats[i - 1]);
  }
  return longest <= shortest + 1;
}

}  // namespace

std::vector<RepeatedPlanes> find_repeated_planes(const Stack& stack) {
  std::vector<RepeatedPlanes> found;
  for (int axis = 0; axis < 3; ++axis) {
    const Planes planes(stack, axis);
    int first = 0, last = count_planes(stack, axis) - 1;
    while (first < last && (!planes.shows_something(first) || planes.are_same(first, first + 1))) ++first;
    while (first < last && (!planes.shows_something(last) || planes.are_same(last - 1, last))) --last;
    RepeatedPlanes repeated;
    repeated.axis = axis;
    for (int i = first; i < last; ++i)
      if (planes.are_same(i, i + 1) && planes.shows_something(i)) repeated.same_as_next.push_back(i);
    repeated.throughout = are_even(repeated.same_as_next, first, last);
    if (!repeated.same_as_next.empty()) found.push_back(repeated);
  }
  return found;
}

std::string described(const RepeatedPlanes& repeated, const Stack& stack) {
  const std::vector<int>& same = repeated.same_as_next;
  // The first place of several.
  std::size_t end = 1;
  while (end < same.size() && same[end] == same[end - 1] + 1) ++end;
  return planes_in_words(stack, repeated.axis, same.front(), same[end - 1] + 1) +
         (end < same.size() ? ", and others" : "");
}

}  // namespace emmetrope::segmentation
