#include "segmentation/output/overlay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/base/files.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/labels/eye_labels.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

constexpr int tile_px = 288, tiles_across = 3, tiles = 6;
constexpr double tile_mm = 36, pixel_mm = tile_mm / tile_px;
constexpr double tile_reach_mm = 8, between_tiles_mm = 2 * tile_reach_mm / (tiles - 1);

/// The slices that are shown: evenly through the globe, each nearest to its place.
std::vector<int> slices_through(const Stack& stack, const Vector3d& centre) {
  std::vector<int> chosen;
  const double middle = stack.normal.dot(centre);
  for (int i = 0; i < tiles; ++i) {
    const double wanted = middle - tile_reach_mm + i * between_tiles_mm;
    int best = 0;
    for (int s = 1; s < stack.slices(); ++s)
      if (std::abs(stack.normal.dot(stack.slice_position[s]) - wanted) <
          std::abs(stack.normal.dot(stack.slice_position[best]) - wanted))
        best = s;
    if (std::find(chosen.begin(), chosen.end(), best) == chosen.end()) chosen.push_back(best);
  }
  return chosen;
}

/// Display axes of a stack: radiological convention (the patient's right at the left of axial and coronal
/// slices, head up), the nose to the left in sagittal ones.
struct DisplayAxes {
  Vector3d right, down;
};
DisplayAxes display_axes(const Stack& stack) {
  Eigen::Index across = 0;
  stack.normal.cwiseAbs().maxCoeff(&across);
  const Vector3d wanted_right = across == 0 ? Vector3d::UnitY() : Vector3d::UnitX();
  const Vector3d wanted_down = across == 2 ? Vector3d::UnitY() : Vector3d(-Vector3d::UnitZ());
  const auto towards = [](const Vector3d& axis, const Vector3d& wanted) -> Vector3d {
    return axis.dot(wanted) < 0 ? Vector3d(-axis) : axis;
  };
  const bool rows_across =
      std::abs(stack.along_row.dot(wanted_right)) >= std::abs(stack.along_column.dot(wanted_right));
  return {towards(rows_across ? stack.along_row : stack.along_column, wanted_right),
          towards(rows_across ? stack.along_column : stack.along_row, wanted_down)};
}

/// Where a direction of LPS points: L, R, P, A, S (head) or I.
const char* direction_letter(const Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  constexpr const char* letters[3][2] = {{"L", "R"}, {"P", "A"}, {"S", "I"}};
  return letters[axis][direction[axis] < 0 ? 1 : 0];
}

/// One slice around the eye, enlarged.
class Tile {
 public:
  Tile(const Stack& stack, int slice, const Vector3d& centre)
      : stack_(stack), slice_(slice), axes_(display_axes(stack)) {
    const Vector3d to_centre = centre - stack.slice_position[slice];
    corner_ = stack.slice_position[slice] + to_centre - to_centre.dot(stack.normal) * stack.normal -
              tile_mm / 2 * (axes_.right + axes_.down);
  }
  Vector3d position(int x, int y) const {
    return corner_ + pixel_mm * ((x + 0.5) * axes_.right + (y + 0.5) * axes_.down);
  }
  cv::Point pixel_of(const Vector3d& position) const {
    const Vector3d from_corner = position - corner_;
    return {static_cast<int>(from_corner.dot(axes_.right) / pixel_mm),
            static_cast<int>(from_corner.dot(axes_.down) / pixel_mm)};
  }
  /// From the slice's middle plane.
  double distance_mm(const Vector3d& position) const {
    return std::abs((position - stack_.slice_position[slice_]).dot(stack_.normal));
  }
  bool is_in_slice(const Vector3d& position) const {
    return distance_mm(position) < stack_.slice_spacing_mm() / 2;
  }
  /// A voxel of the stack about this position.
  void fill_voxel(cv::Mat& image, const Vector3d& position, const cv::Scalar& colour) const {
    const Vector3d from_corner = position - corner_;
    const Vector3d size =
        stack_.column_spacing_mm * stack_.along_row + stack_.row_spacing_mm * stack_.along_column;
    const double w = std::abs(size.dot(axes_.right)) / pixel_mm,
                 h = std::abs(size.dot(axes_.down)) / pixel_mm;
    const double left = from_corner.dot(axes_.right) / pixel_mm - w / 2,
                 top = from_corner.dot(axes_.down) / pixel_mm - h / 2;
    const cv::Point first(static_cast<int>(left), static_cast<int>(top));
    const cv::Point last(static_cast<int>(left + w) - 1, static_cast<int>(top + h) - 1);
    cv::rectangle(image, first, last, colour, cv::FILLED);
  }
  cv::Mat grey(double black, double white) const {
    const cv::Mat slice(stack_.rows, stack_.columns, CV_32F,
                        const_cast<float*>(stack_.slice_intensity[slice_].data()));
    const Vector3d first = position(0, 0) - stack_.slice_position[slice_];
    const auto per_pixel = [&](const Vector3d& display, const Vector3d& along, double spacing_mm) {
      return pixel_mm * display.dot(along) / spacing_mm;
    };
    const double dx = stack_.column_spacing_mm, dy = stack_.row_spacing_mm;
    const cv::Mat warp =
        (cv::Mat_<double>(2, 3) << per_pixel(axes_.right, stack_.along_row, dx),
         per_pixel(axes_.down, stack_.along_row, dx), first.dot(stack_.along_row) / dx,
         per_pixel(axes_.right, stack_.along_column, dy), per_pixel(axes_.down, stack_.along_column, dy),
         first.dot(stack_.along_column) / dy);
    cv::Mat enlarged, scaled, colour;
    cv::warpAffine(slice, enlarged, warp, {tile_px, tile_px}, cv::INTER_CUBIC | cv::WARP_INVERSE_MAP);
    enlarged.convertTo(scaled, CV_8U, 255 / (white - black), -255 * black / (white - black));
    cv::cvtColor(scaled, colour, cv::COLOR_GRAY2BGR);
    return colour;
  }
  /// Stack and slice, notes below them, and at each edge the way to the patient's left, right, front, back, head or
  /// feet.
  void annotate(cv::Mat& image, const std::vector<std::string>& notes) const {
    const auto write = [&](const std::string& text, cv::Point at, double scale) {
      cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, {0, 0, 0}, 3, cv::LINE_AA);
      cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, {255, 255, 255}, 1, cv::LINE_AA);
    };
    write(fmt::format("{} slice {}", stack_.name, slice_ + 1), {6, 16}, 0.42);
    for (std::size_t i = 0; i < notes.size(); ++i) write(notes[i], {6, 31 + 14 * static_cast<int>(i)}, 0.36);
    constexpr int middle = tile_px / 2;
    write(direction_letter(-axes_.right), {5, middle + 5}, 0.5);
    write(direction_letter(axes_.right), {tile_px - 16, middle + 5}, 0.5);
    write(direction_letter(-axes_.down), {middle - 5, 32}, 0.5);
    write(direction_letter(axes_.down), {middle - 5, tile_px - 8}, 0.5);
  }

  const Stack& stack() const { return stack_; }

 private:
  const Stack& stack_;
  int slice_;
  DisplayAxes axes_;
  Vector3d corner_;
};

// Blue, green, red.
const cv::Vec3b lens_colour(0, 140, 255), cornea_colour(230, 210, 0), inner_wall_colour(80, 220, 60),
    edges_colour(255, 120, 40), grey_border(150, 150, 150);

cv::Vec3b colour_between(Label a, Label b) {
  const auto either = [&](Label l) { return a == l || b == l; };
  if (either(Label::lens)) return lens_colour;
  if (either(Label::iris)) return {230, 80, 200};
  if (either(Label::cornea)) return cornea_colour;
  if (either(Label::none)) return {0, 220, 240};
  return inner_wall_colour;
}

/// What of a tile lies where: between two neighbours unlike each other runs a border.
/// \param at  of a position, LPS mm
/// \param colour_between  of two that differ
template <typename At, typename ColourBetween>
void draw_borders(cv::Mat& tile_image, const Tile& tile, const At& at, const ColourBetween& colour_between) {
  std::vector<decltype(at(Vector3d()))> held(static_cast<std::size_t>(tile_px) * tile_px);
  const auto of = [&](int x, int y) -> auto& { return held[static_cast<std::size_t>(y) * tile_px + x]; };
  for (int y = 0; y < tile_px; ++y)
    for (int x = 0; x < tile_px; ++x) of(x, y) = at(tile.position(x, y));
  for (int y = 0; y + 1 < tile_px; ++y)
    for (int x = 0; x + 1 < tile_px; ++x)
      for (const auto next : {of(x + 1, y), of(x, y + 1)})
        if (next != of(x, y)) tile_image.at<cv::Vec3b>(y, x) = colour_between(of(x, y), next);
}

/// \param shift  of the head against the stack `view` of the fit, LPS mm
void draw_fit(cv::Mat& tile_image, const Tile& tile, const EyeFit& fit, std::size_t view,
              const Vector3d& shift, Withholds withheld) {
  const EyeInStack eye(fit, view, tile.stack(), shift);
  // The front chamber and the vitreous are one fluid: no border between them.
  const auto shown = [&](const Vector3d& position) {
    const Label label = eye.at(position);
    return label == Label::anterior_chamber ? Label::vitreous : label;
  };
  const auto is_withheld = [&](Label a, Label b) {
    const auto either = [&](Label l) { return a == l || b == l; };
    const bool is_of_lens = either(Label::iris) || either(Label::lens);
    return withheld == Withholds::fit || (withheld == Withholds::front && is_of_lens) ||
           (withheld != Withholds::nothing && either(Label::cornea));
  };
  draw_borders(tile_image, tile, shown,
               [&](Label a, Label b) { return is_withheld(a, b) ? grey_border : colour_between(a, b); });
}

/// The globe, and crosses where edges lie on its axis.
void draw_edges(cv::Mat& tile_image, const Tile& tile, const ToldEdges& told) {
  const EdgeEllipsoid& globe = told.reading.globe;
  const Vector3d centre = globe.centre + told.shift;
  const auto is_inside = [&](const Vector3d& position) -> unsigned char {
    const Vector3d in_axes = globe.axes.transpose() * (position - centre);
    return in_axes.cwiseQuotient(globe.half_axes).squaredNorm() < 1 ? 1 : 0;
  };
  draw_borders(tile_image, tile, is_inside, [](int, int) { return edges_colour; });
  if (!told.with_axis || !told.reading.axial) return;
  const AxialEdges& axial = *told.reading.axial;
  for (const auto& [along_mm, colour] : {std::pair{axial.inner_cornea_mm, cornea_colour},
                                         {axial.lens_front_mm, lens_colour},
                                         {axial.lens_back_mm, lens_colour},
                                         {axial.inner_wall_mm, edges_colour}}) {
    const Vector3d place = centre + along_mm * globe.axes.col(2);
    if (tile.distance_mm(place) < between_tiles_mm / 2 + tile.stack().slice_spacing_mm() / 2)
      cv::drawMarker(tile_image, tile.pixel_of(place), colour, cv::MARKER_TILTED_CROSS, 9, 1, cv::LINE_AA);
  }
}

/// Around what lies in the vitreous and is none, by voxels of the stack that shows most of it.
/// \param to_first  from the tile's stack to the first of the fit, LPS mm
void draw_masses(cv::Mat& tile_image, const Tile& tile, const EyeFit& fit, const Vector3d& to_first) {
  cv::Mat held = cv::Mat::zeros(tile_image.size(), CV_8U);
  for (const IntraocularMass* mass : {&fit.mass, &fit.unexplained}) {
    if (mass->voxels.empty()) continue;
    const Stack& stack = *fit.stacks[mass->stack].stack;
    Eigen::Matrix3d axes;
    axes << stack.along_row, stack.along_column, stack.normal;
    const Eigen::Array3d half_mm =
        Eigen::Array3d(stack.column_spacing_mm, stack.row_spacing_mm, stack.slice_spacing_mm()) / 2;
    const int reach = static_cast<int>(std::ceil(half_mm.matrix().norm() / pixel_mm));
    for (const Vector3d& voxel : mass->voxels) {
      const cv::Point middle = tile.pixel_of(voxel - to_first);
      for (int y = std::max(0, middle.y - reach); y <= std::min(tile_px - 1, middle.y + reach); ++y)
        for (int x = std::max(0, middle.x - reach); x <= std::min(tile_px - 1, middle.x + reach); ++x)
          if (((axes.transpose() * (tile.position(x, y) + to_first - voxel)).array().abs() <= half_mm).all())
            held.at<unsigned char>(y, x) = 255;
    }
  }
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(held, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(tile_image, outlines, -1, {60, 60, 255});
}

void write_montage(const std::filesystem::path& file, const std::vector<cv::Mat>& images) {
  const int rows = (static_cast<int>(images.size()) + tiles_across - 1) / tiles_across;
  const int columns = std::min<int>(tiles_across, static_cast<int>(images.size()));
  cv::Mat montage(std::max(rows, 1) * tile_px, std::max(columns, 1) * tile_px, CV_8UC3, cv::Scalar(0, 0, 0));
  for (std::size_t i = 0; i < images.size(); ++i) {
    const int x = static_cast<int>(i) % tiles_across * tile_px,
              y = static_cast<int>(i) / tiles_across * tile_px;
    images[i].copyTo(montage(cv::Rect(x, y, tile_px, tile_px)));
  }
  std::vector<unsigned char> png;
  cv::imencode(".png", montage, png);
  write_file(file, std::string_view(reinterpret_cast<const char*>(png.data()), png.size()));
}

/// Black and white of the display: the darkest and brightest of what lies around the eye.
std::pair<double, double> window(const Stack& stack, const Vector3d& centre) {
  std::vector<double> values;
  for_each_voxel_near(stack, centre, 18,
                      [&](int c, int r, int s, const Vector3d&) { values.push_back(stack.at(c, r, s)); });
  const double black = quantile(values, 0.01), white = quantile(values, 0.995);
  return {black, std::max(white, black + 1e-6)};
}

Vector3d centre_in_view(const EyeFit& fit, std::size_t view) {
  return fit.globe_centre_lps() - fit.head_shift_lps(view);
}

/// \param globe  its centre in the stack, LPS mm
/// \param centre  of the pictures
/// \param draw  on the slice, in grey, what is to be seen
template <typename Draw>
void write_slices(const std::filesystem::path& file, const Stack& stack, const Vector3d& globe,
                  const Vector3d& centre, const std::vector<std::string>& notes, const Draw& draw) {
  const auto [black, white] = window(stack, centre);
  std::vector<cv::Mat> images;
  for (const int slice : slices_through(stack, globe)) {
    const Tile tile(stack, slice, centre);
    cv::Mat image = tile.grey(black, white);
    draw(image, tile);
    tile.annotate(image, notes);
    images.push_back(image);
  }
  write_montage(file, images);
}

/// Between cornea and fundus.
Vector3d middle_of_eye(const Vector3d& globe, const Vector3d& outward) { return globe + 1.5 * outward; }

Vector3d outward_of(const EyeFit& fit) {
  return gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical));
}

constexpr const char* edges_note = "blue: edges";

std::vector<std::string> lines_of(const OverlayNotes& notes) {
  std::vector<std::string> lines;
  if (notes.edges) lines.emplace_back(edges_note);
  if (notes.withheld == Withholds::fit) lines.emplace_back("grey: fit, withheld");
  if (notes.withheld == Withholds::front || notes.withheld == Withholds::cornea)
    lines.emplace_back("grey: withheld");
  return lines;
}

void write_borders(const std::filesystem::path& file, const Stack& stack, const EyeFit& fit, std::size_t view,
                   const Vector3d& shift, const OverlayNotes& notes) {
  const Vector3d globe = centre_in_view(fit, view) - shift;
  write_slices(file, stack, globe, middle_of_eye(globe, outward_of(fit)), lines_of(notes),
               [&](cv::Mat& image, const Tile& tile) {
                 draw_fit(image, tile, fit, view, shift, notes.withheld);
                 if (notes.withheld != Withholds::fit)
                   draw_masses(image, tile, fit, shift + fit.head_shift_lps(view));
                 if (notes.edges) draw_edges(image, tile, *notes.edges);
               });
}

}  // namespace

void write_overlay(const std::filesystem::path& file, const EyeFit& fit, std::size_t view,
                   const OverlayNotes& notes) {
  write_borders(file, *fit.stacks[view].stack, fit, view, Vector3d::Zero(), notes);
}

void write_overlay(const std::filesystem::path& file, const EyeFit& fit, const Stack& other,
                   const Vector3d& shift, const OverlayNotes& notes) {
  write_borders(file, other, fit, 0, shift, notes);
}

void write_edge_overlay(const std::filesystem::path& file, const Stack& stack, const ToldEdges& edges) {
  const EdgeEllipsoid& read = edges.reading.globe;
  const Vector3d globe = read.centre + edges.shift;
  write_slices(file, stack, globe, middle_of_eye(globe, read.axes.col(2)), {edges_note},
               [&](cv::Mat& image, const Tile& tile) { draw_edges(image, tile, edges); });
}

void write_residuals(const std::filesystem::path& file, const EyeFit& fit, std::size_t view) {
  const Vector3d globe = centre_in_view(fit, view);
  write_slices(file, *fit.stacks[view].stack, globe, middle_of_eye(globe, outward_of(fit)), {},
               [&](cv::Mat& image, const Tile& tile) {
                 image *= 0.35;
                 for (std::size_t i = 0; i < fit.samples.size(); ++i) {
                   const Sample& sample = fit.samples[i];
                   if (sample.stack != view || !tile.is_in_slice(sample.position)) continue;
                   const double t = std::clamp(fit.residuals[i] / 4, -1.0, 1.0);
                   const double fade = 255 * (1 - std::abs(t));
                   const cv::Scalar colour =
                       t > 0 ? cv::Scalar(fade, fade, 255) : cv::Scalar(255, fade, fade);
                   tile.fill_voxel(image, sample.position, colour);
                 }
               });
}

void write_plain(const std::filesystem::path& file, const Stack& stack, const Vector3d& centre) {
  write_slices(file, stack, centre, centre, {}, [](cv::Mat&, const Tile&) {});
}

}  // namespace emmetrope::segmentation
