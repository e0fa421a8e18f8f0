#include <algorithm>
#include <cmath>
#include <random>

#include "data_samples/phantom/geometry.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

/// Draws from normal distributions cut off at limits. The standard's own distribution differs between
/// libraries.
class Draw {
 public:
  explicit Draw(unsigned long long seed) : engine_(seed) {}
  double uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1.0p-53; }
  double normal() { return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * pi * uniform()); }
  double normal(double mean, double sd, double low, double high) {
    double value = mean + sd * normal();
    while (value < low || value > high) value = mean + sd * normal();
    return value;
  }

 private:
  std::mt19937_64 engine_;
};

/// What both eyes of a person share, in standard deviations.
struct Person {
  double age, length, curvature, size;
};

EyeGeometry random_eye(Draw& draw, const Person& person, double nasal) {
  const auto shared = [&](double common, double correlation) {
    return correlation * common + std::sqrt(1 - correlation * correlation) * draw.normal();
  };
  EyeGeometry eye;
  const double length = std::clamp(shared(person.length, 0.95), -2.3, 3.0);
  eye.axial_length_mm = 23.6 + 1.05 * length;

  // Corneal power: flatter in longer eyes; astigmatism as a power vector, mostly with the rule.
  const double mean_D =
      43.3 + 1.45 * std::clamp(0.95 * person.curvature + 0.3 * draw.normal() - 0.3 * length, -2.6, 2.6);
  const double j0_D = draw.normal(0.30, 0.50, -1.5, 2.0);
  const double j45_D = draw.normal(0, 0.30, -1.2, 1.2);
  const double half_D = std::hypot(j0_D, j45_D);
  eye.cornea_axis_deg = normalise_axis_deg(0.5 * std::atan2(j45_D, j0_D) / degree);  // the flat meridian
  eye.cornea_radius_x_mm = 337.5 / (mean_D - half_D);
  eye.cornea_radius_y_mm = 337.5 / (mean_D + half_D);
  const double q = draw.normal(-0.20, 0.09, -0.5, 0.1);
  eye.cornea_q_x = q + 0.03 * draw.normal();
  eye.cornea_q_y = q + 0.03 * draw.normal();
  eye.cornea_thickness_mm = draw.normal(0.545, 0.033, 0.45, 0.65);
  eye.cornea_back_ratio = draw.normal(0.83, 0.015, 0.78, 0.88);
  eye.limbus_radius_mm = draw.normal(5.85, 0.20, 5.4, 6.3);

  // Lens: grows and steepens with age; tilted towards the temporal side, about 5 deg less than the eye's own
  // axes differ.
  const double years = person.age - 40;
  eye.lens_thickness_mm = draw.normal(3.90 + 0.022 * years, 0.25, 3.2, 5.2);
  eye.anterior_chamber_depth_mm = draw.normal(3.50 - 0.012 * years + 0.10 * length, 0.22, 2.7, 4.2);
  eye.lens_anterior_radius_mm = draw.normal(10.6 - 0.057 * years, 0.9, 7.0, 13.5);
  eye.lens_posterior_radius_mm = draw.normal(5.9 - 0.012 * years, 0.45, 4.8, 7.2);
  eye.lens_anterior_q = draw.normal(-3.0, 0.8, -5, -0.5);
  eye.lens_posterior_q = draw.normal(-1.2, 0.5, -2.5, 0);
  eye.lens_decentre_x_mm = draw.normal(0, 0.12, -0.4, 0.4);
  eye.lens_decentre_y_mm = draw.normal(0, 0.10, -0.3, 0.3);
  eye.lens_tilt_x_deg = draw.normal(0.8, 1.5, -5, 5);
  eye.lens_tilt_y_deg = draw.normal(-3.0 * nasal, 1.5, -8, 8);
  eye.lens_equator_radius_mm = draw.normal(4.6, 0.12, 4.3, 4.9);
  eye.iris_diameter_mm = draw.normal(4.5, 0.7, 3.0, 6.0);
  eye.iris_thickness_mm = draw.normal(0.40, 0.05, 0.3, 0.5);
  eye.ciliary_thickness_mm = draw.normal(1.2, 0.15, 0.8, 1.6);

  // Globe: wider in larger heads and longer eyes; its front is where the limbus is.
  eye.globe_semi_x_mm = std::clamp(11.46 + 0.28 * shared(person.size, 0.9) + 0.12 * length, 10.6, 12.8);
  eye.globe_semi_y_mm = std::clamp(eye.globe_semi_x_mm - 0.10 + 0.12 * draw.normal(), 10.4, 12.8);
  eye.globe_axis_deg = 0;
  eye.wall_lateral_mm = draw.normal(0.85, 0.08, 0.6, 1.1);
  eye.wall_axial_mm = draw.normal(1.0, 0.1, 0.7, 1.3);
  eye.bulge_height_mm = draw.normal(0.15, 0.25, 0, 0.9);
  eye.bulge_width_deg = draw.normal(18, 3, 12, 25);
  eye.bulge_x_deg = draw.normal(0, 12, -30, 30);
  eye.bulge_y_deg = draw.normal(0, 10, -25, 25);
  eye.lid_thickness_mm = draw.normal(2.0, 0.3, 1.3, 2.8);
  eye.globe_semi_z_mm = matching_globe_semi_z_mm(eye);
  return eye;
}

}  // namespace

HeadGeometry random_head(unsigned long long seed) {
  Draw draw(seed * 0x9E3779B97F4A7C15ULL + 0x1234567ULL);
  HeadGeometry head;
  head.age_years = std::round(20 + 50 * draw.uniform());
  head.lens_index = draw.normal(1.441 - 0.00039 * head.age_years, 0.005, 1.40, 1.46);
  const Person person{head.age_years, draw.normal(), draw.normal(), draw.normal()};
  head.interpupillary_distance_mm = draw.normal(62.5, 3.0, 55, 71);
  head.roll_deg = draw.normal(0, 1.2, -3.5, 3.5);
  head.position_x_mm = draw.normal(0, 2, -6, 6);
  head.position_y_mm = draw.normal(-31, 4, -45, -20);
  head.position_z_mm = draw.normal(2, 5, -15, 15);
  const double horizontal = draw.normal(0, 4, -12, 12);
  const double vertical = draw.normal(-12, 6, -30, 8);
  for (const Laterality laterality : both_eyes) {
    EyeGeometry& eye = head.eye(laterality);
    eye = random_eye(draw, person, laterality == Laterality::od ? 1 : -1);
    eye.gaze_horizontal_deg = horizontal + draw.normal(0, 1, -3, 3);
    eye.gaze_vertical_deg = vertical + draw.normal(0, 1, -3, 3);
  }
  return head;
}

}  // namespace emmetrope::phantom
