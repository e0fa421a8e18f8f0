#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/exchange/glass_catalogue.hpp"
#include "pipeline/eye/exchange/lens_system.hpp"
#include "pipeline/eye/exchange/words.hpp"
#include "pipeline/eye/exchange/zernike_form.hpp"
#include "pipeline/eye/exchange/zmx.hpp"

namespace emmetrope {
namespace {

/// How far from its vertex a surface without formula and clear aperture is told.
constexpr double refracting_reach_mm = 5, retinal_reach_mm = 9;
constexpr double gradient_step_mm = 0.02;
constexpr const char* catalogue_begin = "CC media of ";

/// What says the form of a surface, and the turn of its meridians about its axis.
struct FormLines {
  std::string type, lines;
  double curvature_per_mm = 0, axis_deg = 0, aperture_mm = 0;
};

FormLines conic_lines(double radius_mm, double q) {
  return {"STANDARD", q == 0 ? "" : fmt::format("  CONI {}\n", q), 1 / radius_mm, 0, 0};
}

FormLines biconic_lines(const BiconicFormula& f) {
  if (f.radius_mm.x() == f.radius_mm.y() && f.q.x() == f.q.y()) return conic_lines(f.radius_mm.x(), f.q.x());
  return {"BICONICX", fmt::format("  CONI {}\n  PARM 1 {}\n  PARM 2 {}\n", f.q.y(), f.radius_mm.x(), f.q.x()),
          1 / f.radius_mm.y(), f.axis_deg, 0};
}

/// OSA terms of depth as Noll's.
std::string zernike_lines(double norm_radius_mm, const std::vector<double>& coefficients_mm) {
  std::vector<double> noll(1, 0);
  for (std::size_t j = 0; j < coefficients_mm.size(); ++j) {
    const int osa = static_cast<int>(j), number = noll_number(osa);
    if (noll.size() <= static_cast<std::size_t>(number)) noll.resize(number + 1, 0);
    noll[number] = sign_mirrored_in_x(osa) * coefficients_mm[j];
  }
  std::string lines = fmt::format("  XDAT 1 {} 0 0 1 0 0 \"\"\n  XDAT 2 {} 0 0 1 0 0 \"\"\n", noll.size() - 1,
                                  norm_radius_mm);
  for (std::size_t k = 1; k < noll.size(); ++k)
    lines += fmt::format("  XDAT {} {} 0 0 1 0 0 \"\"\n", k + 2, noll[k]);
  return lines;
}

FormLines fitted_lines(const Surface& surface, double reach_mm, std::vector<std::string>& notes) {
  const ZernikeForm form = zernike_form(*surface.shape, reach_mm);
  notes.push_back(fmt::format(
      "{}: a {} is no surface of Zemax; written as Zernike terms upon a conic, which depart from it by at most "
      "{:.2g} um within {:.2f} mm of its vertex",
      surface.name, surface.shape->type(), form.worst_um, form.norm_radius_mm));
  return {"SZERNSAG",
          fmt::format("  CONI {}\n{}", form.q, zernike_lines(form.norm_radius_mm, form.coefficients_mm)),
          form.curvature_per_mm, 0, form.norm_radius_mm};
}

/// One overload for each formula.
struct FormWriter {
  const Surface& surface;
  double reach_mm;
  std::vector<std::string>& notes;

  FormLines operator()(const std::monostate&) const { return fitted_lines(surface, reach_mm, notes); }
  FormLines operator()(const PlaneFormula&) const { return {"STANDARD", "", 0, 0, 0}; }
  FormLines operator()(const SphereFormula& f) const { return conic_lines(f.radius_mm, 0); }
  FormLines operator()(const ConicFormula& f) const { return conic_lines(f.radius_mm, f.q); }
  FormLines operator()(const BiconicFormula& f) const { return biconic_lines(f); }
  FormLines operator()(const EllipsoidFormula& f) const {
    const Eigen::Vector2d squares = f.semi_axes_mm.head<2>().cwiseAbs2();
    const double depth = f.semi_axes_mm.z();
    return biconic_lines({squares / depth, (squares / (depth * depth)).array() - 1, f.axis_deg});
  }
  FormLines operator()(const ZernikeFormula& f) const {
    const BiconicFormula& base = f.biconic;
    if (base.radius_mm.x() != base.radius_mm.y() || base.q.x() != base.q.y())
      return fitted_lines(surface, reach_mm, notes);
    FormLines form = conic_lines(base.radius_mm.x(), base.q.x());
    form.type = "SZERNSAG";
    std::vector<double> coefficients_mm;
    for (const double um : f.coefficients_um) coefficients_mm.push_back(um / 1000);
    form.lines += zernike_lines(f.norm_radius_mm, coefficients_mm);
    form.axis_deg = base.axis_deg;
    return form;
  }
};

FormLines form_of(const Surface& surface, bool is_retina, std::vector<std::string>& notes) {
  const double reach = surface.semi_diameter_mm > 0 ? surface.semi_diameter_mm
                                                    : (is_retina ? retinal_reach_mm : refracting_reach_mm);
  FormLines form = std::visit(FormWriter{surface, reach, notes}, surface.shape->formula());
  if (surface.semi_diameter_mm > 0)
    form.aperture_mm = form.aperture_mm > 0 ? std::min(form.aperture_mm, surface.semi_diameter_mm)
                                            : surface.semi_diameter_mm;
  if (is_retina) form.aperture_mm = surface.semi_diameter_mm;
  return form;
}

/// Gradient 3: n = n0 + nr2 r^2 + nr4 r^4 + nr6 r^6 + nz1 z + nz2 z^2 + nz3 z^3.
std::string gradient_lines(const std::string& medium, const GradientIndex& gradient) {
  std::string lines = fmt::format("  PARM 1 {}\n", gradient_step_mm);
  for (const GradientIndex::Term& term : gradient.terms) {
    int place = 0;
    if (term.depth_power == 0 && term.radius_power <= 6) place = 2 + term.radius_power / 2;
    if (term.radius_power == 0 && term.depth_power >= 1 && term.depth_power <= 3)
      place = 5 + term.depth_power;
    if (place == 0)
      throw unsupported_error(
          fmt::format("the medium {}: a term t^{} r^{} has no place in Zemax's Gradient 3", medium,
                      term.depth_power, term.radius_power));
    lines += fmt::format("  PARM {} {}\n", place, term.coefficient);
  }
  return lines;
}

/// A name that a catalogue can hold.
std::string glass_name(const std::string& medium) {
  std::string name = capitals(medium);
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return name.substr(0, 20);
}

class ZmxWriter {
 public:
  ZmxWriter(const EyeModel& eye, std::vector<std::string>& notes) : eye_(eye), notes_(notes) {}

  std::string lens(const std::string& catalogue) {
    text_ =
        fmt::format("VERS 180212 0 0\nMODE SEQ\nNAME {}\nUNIT MM X W X CM MR CPMM\n", one_line(eye_.name));
    text_ += fmt::format("FLOA\nGCAT {}\nFTYP 0 0 1 1 0 0 0\nXFLN 0\nYFLN 0\n", catalogue);
    text_ += fmt::format("WAVM 1 {} 1\nPWAV 1\n", eye_.reference_wavelength_nm / 1000);
    text_ += "SURF 0\n  TYPE STANDARD\n  CURV 0\n  DISZ INFINITY\n  DIAM 0 0 0 0 1 \"\"\n";
    std::string medium = "air";
    for (std::size_t k = 0; k < eye_.surfaces.size(); ++k) {
      const Surface& surface = eye_.surfaces[k];
      if (!surface.is_stop()) medium = surface.medium_after;
      const bool last = k + 1 == eye_.surfaces.size();
      write(surface, medium, last, last ? 0 : eye_.surfaces[k + 1].position_mm - surface.position_mm);
    }
    return text_;
  }

  std::string catalogue() {
    std::string text = fmt::format("{}{}\n", catalogue_begin, one_line(eye_.name));
    for (const auto& [name, as_glass] : glasses_) {
      const CatalogueGlass glass = catalogue_glass(as_glass, eye_.medium(name), eye_.reference_wavelength_nm);
      if (glass.worst_index > 1e-9)
        notes_.push_back(fmt::format(
            "the medium {}: its dispersion is told by Schott's formula, which departs from it by at most {:.1g} "
            "between 380 and 1000 nm",
            name, glass.worst_index));
      text += glass.text;
    }
    return text;
  }

 private:
  static std::string one_line(std::string text) {
    std::replace_if(
        text.begin(), text.end(), [](unsigned char c) { return c < 32; }, ' ');
    return text;
  }

  void write(const Surface& surface, const std::string& medium, bool last, double to_next_mm) {
    FormLines form{"STANDARD", "", 0, 0, 0};
    if (!surface.is_stop()) form = form_of(surface, last, notes_);
    const Eigen::Isometry3d pose = light_from_surface(surface, form.axis_deg);
    const bool apart = !pose.linear().isIdentity(0) || pose.translation().head<2>().squaredNorm() > 0;
    if (apart) coordinate_break(pose, false, 0);
    text_ += fmt::format("SURF {}\n", ++number_);
    if (surface.is_stop()) text_ += "  STOP\n";
    const bool gradient = !surface.is_stop() && !last && eye_.medium(medium).gradient.has_value();
    text_ += fmt::format("  COMM {}\n  TYPE {}\n  CURV {}\n", surface.name, gradient ? "GRINSUR3" : form.type,
                         form.curvature_per_mm);
    text_ += form.lines;
    if (gradient) add_gradient(surface, form, medium);
    text_ += fmt::format("  DISZ {}\n", apart ? 0 : to_next_mm);
    if (!last && !gradient && medium != "air") add_glass(medium);
    const double semi_diameter = surface.is_stop() ? surface.stop_diameter_mm / 2 : form.aperture_mm;
    text_ += fmt::format("  DIAM {} {} 0 0 1 \"\"\n", semi_diameter, semi_diameter > 0 ? 1 : 0);
    if (form.aperture_mm > 0) text_ += fmt::format("  CLAP 0 {} 0\n", form.aperture_mm);
    if (apart && !last) coordinate_break(pose, true, to_next_mm);
  }

  void add_gradient(const Surface& surface, const FormLines& form, const std::string& medium) {
    if (form.type != "STANDARD")
      throw unsupported_error(surface.name + ": Zemax's gradients begin at spheres and conics only");
    const Medium& gradient = eye_.medium(medium);
    text_ += gradient_lines(medium, *gradient.gradient);
    if (gradient.dispersion.formula != Dispersion::Formula::constant)
      notes_.push_back("the medium " + medium + ": Zemax's Gradient 3 has no dispersion, it is left out");
  }

  void add_glass(const std::string& medium) {
    if (glasses_.count(medium) == 0) {
      std::string name = glass_name(medium);
      // Media may differ in what a catalogue cannot tell apart.
      const auto taken = [&](const auto& glass) { return glass.second == name; };
      for (int k = 2; std::any_of(glasses_.begin(), glasses_.end(), taken); ++k)
        name = fmt::format("{}_{}", glass_name(medium), k);
      glasses_[medium] = name;
    }
    text_ += fmt::format("  GLAS {} 0 0 {} 0 0 0 0 0 0 0\n", glasses_.at(medium), eye_.medium(medium).index);
  }

  /// Without the depth of its vertex.
  static Eigen::Isometry3d light_from_surface(const Surface& surface, double axis_deg) {
    Eigen::Isometry3d pose = surface.eye_from_surface();
    if (axis_deg != 0) pose.rotate(Eigen::AngleAxisd(axis_deg * degree, Eigen::Vector3d::UnitZ()));
    Eigen::Isometry3d in_light = Eigen::Isometry3d::Identity();
    in_light.linear() = half_turn * pose.linear() * half_turn;
    in_light.translation() = half_turn * pose.translation();
    in_light.translation().z() = 0;
    return in_light;
  }

  void coordinate_break(const Eigen::Isometry3d& pose, bool back, double to_next_mm) {
    const Eigen::Matrix3d& r = pose.linear();
    // r = Rx Ry Rz
    const double x = std::atan2(-r(1, 2), r(2, 2)), y = std::asin(std::clamp(r(0, 2), -1.0, 1.0)),
                 z = std::atan2(-r(0, 1), r(0, 0));
    const double sign = back ? -1 : 1;
    text_ += fmt::format("SURF {}\n  TYPE COORDBRK\n  CURV 0\n", ++number_);
    const std::array<double, 5> values{pose.translation().x(), pose.translation().y(), x / degree, y / degree,
                                       z / degree};
    for (std::size_t k = 0; k < values.size(); ++k)
      text_ += fmt::format("  PARM {} {}\n", k + 1, sign * values[k]);
    text_ += fmt::format("  PARM 6 {}\n  DISZ {}\n  DIAM 0 0 0 0 1 \"\"\n", back ? 1 : 0, to_next_mm);
  }

  const EyeModel& eye_;
  std::vector<std::string>& notes_;
  std::string text_;
  std::map<std::string, std::string> glasses_;  ///< names in the catalogue, by medium
  int number_ = 0;
};

/// Nobody asked for this file by its name.
void require_own_catalogue(const std::filesystem::path& file) {
  if (std::filesystem::exists(file) && read_file(file).rfind(catalogue_begin, 0) != 0)
    throw output_error(file.string() + " was not written by emmetrope, and the lens's glasses would go there",
                       "move it elsewhere, or give the lens another name");
}

}  // namespace

std::filesystem::path glass_catalogue_beside(std::filesystem::path zmx) {
  return zmx.replace_extension(".agf");
}

std::vector<std::string> write_zmx(const std::filesystem::path& file, const EyeModel& eye) {
  std::vector<std::string> notes;
  ZmxWriter writer(eye, notes);
  const std::filesystem::path catalogue = glass_catalogue_beside(file);
  const std::string lens = writer.lens(file.stem().string());
  const std::string glasses = writer.catalogue();
  require_own_catalogue(catalogue);
  write_file(catalogue, glasses);
  write_file(file, lens);
  return notes;
}

}  // namespace emmetrope
