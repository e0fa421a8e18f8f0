#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "raytrace/wavefront/contrast_sensitivity.hpp"
#include "raytrace/wavefront/pupil_function.hpp"
#include "raytrace/wavefront/simplex.hpp"

namespace emmetrope::raytrace {
namespace {

/// Beyond it the eye's sensitivity to contrast is nothing.
constexpr int highest_weighted_cpd = 60;

/// The lens in the pupil as the search knows it, and the search's figures.
using LensPowers = Eigen::Vector3d;
PowerVector power_from(const LensPowers& lens) { return {lens[0], lens[1], lens[2]}; }

/// Of the wavefront's terms from the second order, um per mm.
Eigen::Vector2d slope_at(const Wavefront& wavefront, const Eigen::Vector2d& place_mm) {
  const double radius_mm = wavefront.pupil_mm / 2;
  Eigen::Vector2d slope(0, 0);
  for (std::size_t j = 3; j < wavefront.zernike_um.size(); ++j)
    if (wavefront.zernike_um[j] != 0)
      slope += wavefront.zernike_um[j] / radius_mm *
               zernike_jet(static_cast<int>(j), place_mm.x() / radius_mm, place_mm.y() / radius_mm).gradient;
  return slope;
}

/// Samples over the pupil so that the phase turns by less than half a wave from one to the next: then the
/// point spread function fits into its grid, too.
double samples_needed(const Wavefront& wavefront) {
  constexpr int rings = 8, spokes = 48;
  std::vector<Eigen::Vector2d> slopes;
  Eigen::Vector2d mean(0, 0);
  double area = 0;
  for (int k = 0; k < spokes; ++k) {
    const double angle = 2 * pi * k / spokes, rim_mm = rim_of(wavefront).at(angle);
    for (int ring = 1; ring <= rings; ++ring) {
      const double radius_mm = rim_mm * ring / rings, share = radius_mm * rim_mm;
      slopes.push_back(slope_at(wavefront, radius_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
      mean += share * slopes.back();
      area += share;
    }
  }
  mean /= area;
  double largest_um_per_mm = 0;
  for (const Eigen::Vector2d& slope : slopes)
    largest_um_per_mm = std::max(largest_um_per_mm, (slope - mean).norm());
  return 2 * wavefront.pupil_mm * largest_um_per_mm / (wavefront.wavelength_nm / 1000);
}

constexpr int least_samples = 128;
constexpr int most_samples = 1024;

PupilFunction sampled(const Wavefront& wavefront, const Eigen::Vector2d& up = {0, 1}) {
  const int samples =
      static_cast<int>(std::clamp(samples_needed(wavefront), 1.0 * least_samples, 1.0 * most_samples));
  return {wavefront, samples, samples > 512 ? 2.0 : 3.0, up};
}

/// Where diffraction by the pupil's circle lets no contrast through any more.
double cut_off_cpd(const Wavefront& wavefront) {
  return wavefront.pupil_mm / (wavefront.wavelength_nm * 1e-6) * degree;
}

/// Integral of Re(OTF) over frequencies up to 60 cycles a degree weighted by contrast sensitivity.
class SensitivitySum {
 public:
  explicit SensitivitySum(const PupilFunction& pupil)
      : area_cpd2_(1.0 / (pupil.per_cpd() * pupil.per_cpd())) {
    const int size = pupil.size(), reach = std::min(highest_weighted_cpd * pupil.per_cpd(), size / 2);
    for (int row = -reach; row <= reach; ++row)
      for (int column = -reach; column <= reach; ++column) {
        const double cpd = std::hypot(row, column) / pupil.per_cpd();
        if (cpd > highest_weighted_cpd || 2 * std::max(std::abs(row), std::abs(column)) >= size) continue;
        entries_.push_back(
            {((row + size) % size) * size + (column + size) % size, contrast_sensitivity(cpd)});
      }
  }
  double of(const std::vector<std::complex<double>>& otf) const {
    double sum = 0;
    for (const auto& [index, weight] : entries_) sum += weight * otf[index].real();
    return area_cpd2_ * sum;
  }

 private:
  struct Entry {
    int index;
    double weight;
  };
  double area_cpd2_;  ///< of a frequency's square
  std::vector<Entry> entries_;
};

/// Of the same pupil without aberration: few samples do.
double perfect_sensitivity_sum(const Wavefront& wavefront) {
  const PupilFunction pupil(wavefront, least_samples, 3, wavefront.tangential);
  return SensitivitySum(pupil).of(pupil.otf(pupil.perfect_point_spread()));
}

/// The spot diagram: the angles of the rays in object space about the line of sight, along eye x and y.
Json spot_json(const Wavefront& wavefront) {
  constexpr double arcmin = degree / 60;
  Json x = Json::array(), y = Json::array();
  for (const Wavefront::PupilRay& ray : wavefront.rays) {
    x.push_back(ray.slope.x() / arcmin);
    y.push_back(ray.slope.y() / arcmin);
  }
  return {{"rms_arcmin", wavefront.spot_rms_arcmin()}, {"x_arcmin", x}, {"y_arcmin", y}};
}

}  // namespace

// c = power r^2 / (4 sqrt 3), r^2 / (2 sqrt 6).
Wavefront with_lens(Wavefront wavefront, const PowerVector& lens_in_pupil) {
  const double square = wavefront.pupil_mm * wavefront.pupil_mm / 4;
  wavefront.zernike_um.resize(std::max<std::size_t>(wavefront.zernike_um.size(), 6), 0);
  wavefront.zernike_um[3] += lens_in_pupil.J45_D * square / (2 * std::sqrt(6.0));
  wavefront.zernike_um[4] += lens_in_pupil.M_D * square / (4 * std::sqrt(3.0));
  wavefront.zernike_um[5] += lens_in_pupil.J0_D * square / (2 * std::sqrt(6.0));
  return wavefront;
}

ImageQuality image_quality(const Wavefront& uncorrected, const PowerVector& lens_in_pupil) {
  const Wavefront wavefront = with_lens(uncorrected, lens_in_pupil);
  const PupilFunction pupil = sampled(wavefront, wavefront.tangential);
  const std::vector<double> spread = pupil.point_spread({});
  const std::vector<std::complex<double>> otf = pupil.otf(spread);
  ImageQuality quality;
  quality.strehl = pupil.strehl({}, spread);
  quality.vsotf = SensitivitySum(pupil).of(otf) / perfect_sensitivity_sum(wavefront);
  for (int cpd = 0; cpd <= cut_off_cpd(wavefront); ++cpd) {
    const int step = cpd * pupil.per_cpd();
    const bool inside = 2 * step < pupil.size();
    quality.cpd.push_back(cpd);
    quality.mtf_sagittal.push_back(inside ? std::abs(otf[step]) : 0);
    quality.mtf_tangential.push_back(inside ? std::abs(otf[static_cast<std::size_t>(step) * pupil.size()])
                                            : 0);
  }
  return quality;
}

PointSpread point_spread(const Wavefront& uncorrected, const PowerVector& lens_in_pupil) {
  const Wavefront wavefront = with_lens(uncorrected, lens_in_pupil);
  const PupilFunction pupil = sampled(wavefront);
  const std::vector<double> spread = pupil.point_spread({});
  PointSpread result;
  result.size = pupil.size();
  result.wraps = samples_needed(wavefront) > most_samples;
  result.pitch_arcmin = pupil.pitch_arcmin();
  result.values.resize(spread.size());
  const double sum = std::accumulate(spread.begin(), spread.end(), 0.0);
  const int n = pupil.size(), half = n / 2;
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column)
      // Zero angle at (half, half), x to the left.
      result.values[static_cast<std::size_t>(row) * n + column] = static_cast<float>(
          spread[static_cast<std::size_t>((half - row + n) % n) * n + (half - column + n) % n] / sum);
  return result;
}

RefractionCriteria refraction_by_wavefront(const Wavefront& wavefront, double vertex_distance_mm) {
  // Searched from the other criteria: a scan of the sphere first, as the through-focus curve may have side
  // lobes.
  const PowerVector& start = wavefront.minimum_rms_wavefront;
  // Without its second order the sampling suffices all along the search.
  const PupilFunction pupil(with_lens(wavefront, start), 96, 2);
  const SensitivitySum weighted(pupil);
  const double perfect = weighted.of(pupil.otf(pupil.perfect_point_spread()));
  const auto loss = [&](const LensPowers& lens) {
    return -weighted.of(pupil.otf(pupil.point_spread(power_from(lens)))) / perfect;
  };
  const double away = wavefront.paraxial.M_D - start.M_D;
  LensPowers best = LensPowers::Zero();
  double best_loss = loss(best);
  constexpr double step_D = 0.125;
  for (double m = std::min(0.0, away) - 0.75; m <= std::max(0.0, away) + 0.75; m += step_D) {
    const LensPowers lens(m, 0, 0);
    const double value = loss(lens);
    if (value < best_loss) {
      best_loss = value;
      best = lens;
    }
  }
  best = minimise(loss, best, step_D, 1e-3);
  const PowerVector visual{start.M_D + best[0], start.J0_D + best[1], start.J45_D + best[2]};
  return {at_vertex(wavefront, wavefront.paraxial, vertex_distance_mm),
          at_vertex(wavefront, wavefront.minimum_rms_wavefront, vertex_distance_mm),
          at_vertex(wavefront, wavefront.minimum_rms_spot, vertex_distance_mm),
          at_vertex(wavefront, visual, vertex_distance_mm)};
}

RefractionCriteria refraction_by_wavefront(const EyeModel& eye, const WavefrontSettings& settings,
                                           double vertex_distance_mm) {
  return refraction_by_wavefront(measure_wavefront(eye, settings), vertex_distance_mm);
}

Json wavefront_json(const Wavefront& wavefront) {
  const ImageQuality quality = image_quality(wavefront);
  return {
      {"pupil_mm", wavefront.pupil_mm},
      {"pupil_position_mm", wavefront.pupil_position_mm},
      {"pupil_rim_mm", wavefront.rim.radius_mm},
      {"stiles_crawford_per_mm2", wavefront.stiles_crawford_per_mm2},
      {"pupil_magnification", wavefront.pupil_magnification},
      {"wavelength_nm", wavefront.wavelength_nm},
      {"zernike_um", wavefront.zernike_um},
      {"rms_um", wavefront.rms_um()},
      {"higher_order_rms_um", wavefront.higher_order_rms_um()},
      {"fit_residual_rms_um", wavefront.fit_residual_rms_um},
      {"line_of_sight_deg", {wavefront.line_of_sight_deg.x(), wavefront.line_of_sight_deg.y()}},
      {"tangential_deg",
       normalise_axis_deg(std::atan2(wavefront.tangential.y(), wavefront.tangential.x()) / degree)},
      {"spot", spot_json(wavefront)},
      {"strehl", quality.strehl},
      {"vsotf", quality.vsotf},
      {"mtf",
       {{"cpd", quality.cpd}, {"tangential", quality.mtf_tangential}, {"sagittal", quality.mtf_sagittal}}}};
}

Json to_json(const RefractionCriteria& refraction) {
  const auto power = [](const PowerVector& p) {
    return Json{{"M_D", p.M_D}, {"J0_D", p.J0_D}, {"J45_D", p.J45_D}};
  };
  return {{"paraxial", power(refraction.paraxial)},
          {"minimum_rms_wavefront", power(refraction.minimum_rms_wavefront)},
          {"minimum_rms_spot", power(refraction.minimum_rms_spot)},
          {"visual_strehl", power(refraction.visual_strehl)}};
}

}  // namespace emmetrope::raytrace
