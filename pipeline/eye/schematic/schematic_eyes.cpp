#include "pipeline/eye/schematic/schematic_eyes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/exchange/eye_file.hpp"
#include "pipeline/eye/media/ocular_media.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/optics/paraxial.hpp"

// Published schematic eyes. docs/method/schematic-eyes.md names the sources and what was chosen where they say
// nothing.
namespace emmetrope {
namespace {

constexpr double default_pupil_mm = 4;
/// For sources that describe no retina: only its vertex enters paraxial figures.
constexpr double default_retina_radius_mm = -12;

/// A refracting surface and the medium behind it.
struct Layer {
  const char* name;
  double radius_mm;  ///< infinite: a plane
  double q;
  double thickness_mm;  ///< to the next surface
  const char* medium;
};

ShapePtr shape_of(double radius_mm, double q) {
  if (std::isinf(radius_mm)) return make_plane();
  return q == 0 ? make_sphere(radius_mm) : make_conic(radius_mm, q);
}

/// Layers from the cornea on, the iris at the vertex of the lens front, the retina behind the last thickness.
EyeModel build(const char* name, double reference_nm, const std::vector<Layer>& layers,
               std::map<std::string, Medium> media, ShapePtr retina = make_sphere(default_retina_radius_mm)) {
  EyeModel eye;
  eye.name = name;
  eye.reference_wavelength_nm = reference_nm;
  eye.media = std::move(media);
  double depth = 0;
  for (const Layer& layer : layers) {
    Surface surface;
    surface.position_mm = depth;
    if (std::string(layer.name) == "lens_anterior") {
      surface.name = "iris";
      surface.stop_diameter_mm = default_pupil_mm;
      eye.surfaces.push_back(surface);
      surface.stop_diameter_mm = 0;
    }
    surface.name = layer.name;
    surface.shape = shape_of(layer.radius_mm, layer.q);
    surface.medium_after = layer.medium;
    eye.surfaces.push_back(surface);
    depth += layer.thickness_mm;
  }
  Surface last;
  last.name = "retina";
  last.shape = std::move(retina);
  last.position_mm = depth;
  eye.surfaces.push_back(last);
  return eye;
}

/// Puts the retina where the relaxed eye has its image focus, for sources that name none.
EyeModel retina_at(EyeModel eye, double depth_mm) {
  eye.surfaces.back().position_mm = depth_mm;
  return eye;
}

double between(double relaxed, double accommodated, double fraction) {
  return relaxed + fraction * (accommodated - relaxed);
}

/// Radii are interpolated as curvatures.
double radius_between(double relaxed_mm, double accommodated_mm, double fraction) {
  return 1 / between(1 / relaxed_mm, 1 / accommodated_mm, fraction);
}

/// Gullstrand's exact eye; `demand_D` is the accommodation of Atchison and Smith's interpolation of its two
/// states.
EyeModel gullstrand(double demand_D) {
  const double step = 1.052 * demand_D - 0.00531 * demand_D * demand_D + 0.000048564 * std::pow(demand_D, 3);
  const double f = std::min(step / 10.87013, 1.0);
  const double front_cortex = between(0.546, 0.6725, f), core = between(2.419, 2.655, f);
  const double back_cortex = between(0.635, 0.6725, f), chamber = between(3.1, 2.7, f);
  EyeModel eye =
      build("gullstrand", 589.3,
            {{"cornea_anterior", 7.7, 0, 0.5, "cornea"},
             {"cornea_posterior", 6.8, 0, chamber, "aqueous"},
             {"lens_anterior", radius_between(10, 5.333, f), 0, front_cortex, "lens_cortex"},
             {"nucleus_anterior", radius_between(7.911, 2.655, f), 0, core, "lens_core"},
             {"nucleus_posterior", radius_between(-5.76, -2.655, f), 0, back_cortex, "lens_cortex"},
             {"lens_posterior", radius_between(-6, -5.333, f), 0, 0, "vitreous"}},
            {{"cornea", cornea_medium()},
             {"aqueous", aqueous_medium(1.336)},
             {"lens_cortex", lens_medium(lens_cortex_index)},
             {"lens_core", lens_medium(lens_core_index)},
             {"vitreous", vitreous_medium(1.336)}});
  return retina_at(eye, 24.3854);
}

EyeModel gullstrand_emsley(double f) {
  EyeModel eye = build("gullstrand-emsley", 589.3,
                       {{"cornea_anterior", 7.8, 0, between(3.6, 3.2, f), "aqueous"},
                        {"lens_anterior", radius_between(10, 5, f), 0, between(3.6, 4, f), "lens"},
                        {"lens_posterior", radius_between(-6, -5, f), 0, 0, "vitreous"}},
                       {{"aqueous", aqueous_medium(4.0 / 3)},
                        {"lens", lens_medium(1.416)},
                        {"vitreous", vitreous_medium(4.0 / 3)}});
  return f == 0 ? retina_at(eye, cardinal_points(eye, 589.3).image_focal_mm)
                : retina_at(eye, gullstrand_emsley(0).axial_length_mm());
}

EyeModel le_grand(double f) {
  EyeModel eye = build("le-grand", 589.3,
                       {{"cornea_anterior", 7.8, 0, 0.55, "cornea"},
                        {"cornea_posterior", 6.5, 0, between(3.05, 2.65, f), "aqueous"},
                        {"lens_anterior", radius_between(10.2, 6, f), 0, between(4, 4.5, f), "lens"},
                        {"lens_posterior", radius_between(-6, -5.5, f), 0, 0, "vitreous"}},
                       {{"cornea", cornea_medium(1.3771)},
                        {"aqueous", aqueous_medium(1.3374)},
                        {"lens", lens_medium(between(1.42, 1.427, f))},
                        {"vitreous", vitreous_medium(1.336)}},
                       make_sphere(-13.4));
  return retina_at(eye, 24.19655);
}

/// Navarro's Herzberger formula: coefficients from the indices at four wavelengths (n**, nF, nC, n*).
Medium navarro_medium(double index, const std::array<double, 4>& n) {
  static constexpr double matrix[4][4] = {{0.66147196, -0.40352796, -0.28046790, 0.03385979},
                                          {-4.20146383, 2.73508956, 1.50543784, -0.11593235},
                                          {6.29834237, -4.69409935, -1.57508650, 0.10293038},
                                          {-1.75835059, 2.36253794, 0.35011657, -0.02085782}};
  std::vector<double> coefficients(4, 0);
  for (int k = 0; k < 4; ++k)
    for (int i = 0; i < 4; ++i) coefficients[k] += n[i] * matrix[i][k];
  return {index, {Dispersion::Formula::herzberger, coefficients}, {}};
}

EyeModel navarro(double a) {
  const double l = std::log(a + 1);
  EyeModel eye =
      build("navarro", 589.3,
            {{"cornea_anterior", 7.72, -0.26, 0.55, "cornea"},
             {"cornea_posterior", 6.5, 0, 3.05 - 0.05 * l, "aqueous"},
             {"lens_anterior", 10.2 - 1.75 * l, -3.1316 - 0.34 * l, 4 + 0.1 * l, "lens"},
             {"lens_posterior", -6 + 0.2294 * l, -1 - 0.125 * l, 0, "vitreous"}},
            {{"cornea", navarro_medium(1.376, {1.3975, 1.3807, 1.37405, 1.3668})},
             {"aqueous", navarro_medium(1.3374, {1.3593, 1.3422, 1.3354, 1.3278})},
             {"lens", navarro_medium(1.42 + 9e-5 * (10 * a + a * a), {1.4492, 1.42625, 1.4175, 1.4097})},
             {"vitreous", navarro_medium(1.336, {1.3565, 1.3407, 1.3341, 1.3273})}});
  return retina_at(eye, 24.00398);
}

EyeModel escudero_sanz_navarro(double) {
  const auto medium = [](double n458, double n543, double n589, double n633) {
    return Medium{n543, {Dispersion::Formula::table, {458, n458, 543, n543, 589.3, n589, 632.8, n633}}, {}};
  };
  return build("escudero-sanz-navarro", 543,
               {{"cornea_anterior", 7.72, -0.26, 0.55, "cornea"},
                {"cornea_posterior", 6.5, 0, 3.05, "aqueous"},
                {"lens_anterior", 10.2, -3.1316, 4, "lens"},
                {"lens_posterior", -6, -1, 16.3203, "vitreous"}},
               {{"cornea", medium(1.3828, 1.3777, 1.376, 1.3747)},
                {"aqueous", medium(1.3445, 1.3391, 1.3374, 1.336)},
                {"lens", medium(1.4292, 1.4222, 1.42, 1.4183)},
                {"vitreous", medium(1.3428, 1.3377, 1.336, 1.3347)}});
}

/// A lens of two gradients that meet in a plane.
Medium gradient_medium(const GradientIndex& gradient, const Dispersion& dispersion) {
  return {gradient.index(0, 0), dispersion, gradient};
}

EyeModel liou_brennan(double) {
  const Dispersion dispersion{Dispersion::Formula::polynomial, {0.0512, -0.1455, 0.0961}};
  EyeModel eye = build(
      "liou-brennan", 555,
      {{"cornea_anterior", 7.77, -0.18, 0.5, "cornea"},
       {"cornea_posterior", 6.4, -0.6, 3.16, "aqueous"},
       {"lens_anterior", 12.4, -0.94, 1.59, "lens_front"},
       {"lens_middle", std::numeric_limits<double>::infinity(), 0, 2.43, "lens_back"},
       {"lens_posterior", -8.1, 0.96, 16.27, "vitreous"}},
      {{"cornea", {1.376, dispersion, {}}},
       {"aqueous", {1.336, dispersion, {}}},
       {"lens_front",
        gradient_medium({{{0, 0, 1.368}, {1, 0, 0.049057}, {2, 0, -0.015427}, {0, 2, -0.001978}}},
                        dispersion)},
       {"lens_back", gradient_medium({{{0, 0, 1.407}, {2, 0, -0.006605}, {0, 2, -0.001978}}}, dispersion)},
       {"vitreous", {1.336, dispersion, {}}}});
  eye.surface("iris").decentre_mm = {0.5, 0};  // nasal in a right eye
  return eye;
}

EyeModel atchison(double spectacle_D) {
  const Dispersion lens_dispersion = lens_medium(1).dispersion;
  return build("atchison", 555,
               {{"cornea_anterior", 7.77 + 0.022 * spectacle_D, -0.15, 0.55, "cornea"},
                {"cornea_posterior", 6.4, -0.275, 3.15, "aqueous"},
                {"lens_anterior", 11.48, -5, 1.44, "lens_front"},
                {"lens_middle", std::numeric_limits<double>::infinity(), 0, 2.16, "lens_back"},
                {"lens_posterior", -5.9, -2, 16.28 - 0.299 * spectacle_D, "vitreous"}},
               {{"cornea", cornea_medium()},
                {"aqueous", aqueous_medium(1.3374)},
                {"lens_front",
                 gradient_medium({{{0, 0, 1.371}, {1, 0, 0.0652778}, {2, 0, -0.0226659}, {0, 2, -0.0020399}}},
                                 lens_dispersion)},
                {"lens_back",
                 gradient_medium({{{0, 0, 1.418}, {2, 0, -0.0100737}, {0, 2, -0.0020399}}}, lens_dispersion)},
                {"vitreous", vitreous_medium(1.336)}},
               make_biconic(-12.91 - 0.094 * spectacle_D, -12.72 + 0.004 * spectacle_D,
                            0.27 + 0.026 * spectacle_D, 0.25 + 0.017 * spectacle_D, 0));
}

EyeModel arizona(double a) {
  const auto medium = [](double n_d, double v) {
    return Medium{n_d, {Dispersion::Formula::abbe, {n_d, v}}, {}};
  };
  return build("arizona", 587.6,
               {{"cornea_anterior", 7.8, -0.25, 0.55, "cornea"},
                {"cornea_posterior", 6.5, -0.25, 2.97 - 0.04 * a, "aqueous"},
                {"lens_anterior", 12 - 0.4 * a, -7.518749 + 1.28572 * a, 3.767 + 0.04 * a, "lens"},
                {"lens_posterior", -5.224557 + 0.2 * a, -1.353971 - 0.431762 * a, 16.713, "vitreous"}},
               {{"cornea", medium(1.377, 57.1)},
                {"aqueous", medium(1.337, 61.3)},
                {"lens", medium(1.42 + 0.00256 * a - 0.00022 * a * a, 51.9)},
                {"vitreous", medium(1.336, 61.1)}},
               make_sphere(-13.4));
}

/// Five published states, 2.5 D apart; between them curvatures and depths are linear.
EyeModel bennett_rabbetts(double a) {
  struct State {
    double chamber, front, thickness, back;
  };
  static constexpr std::array<State, 5> states{{{3.6, 11, 3.7, -6.47515},
                                                {3.475, 8.6, 3.825, -5.909},
                                                {3.37, 7.0, 3.93, -5.504},
                                                {3.28, 6.0, 4.02, -5.063},
                                                {3.21, 5.2, 4.09, -4.75}}};
  const int k = std::min(static_cast<int>(a / 2.5), 3);
  const double f = a / 2.5 - k;
  const State &from = states[k], &to = states[k + 1];
  EyeModel eye = build("bennett-rabbetts", 589.3,
                       {{"cornea_anterior", 7.8, 0, between(from.chamber, to.chamber, f), "aqueous"},
                        {"lens_anterior", radius_between(from.front, to.front, f), 0,
                         between(from.thickness, to.thickness, f), "lens"},
                        {"lens_posterior", radius_between(from.back, to.back, f), 0, 0, "vitreous"}},
                       {{"aqueous", aqueous_medium(1.336)},
                        {"lens", lens_medium(1.422)},
                        {"vitreous", vitreous_medium(1.336)}});
  return a == 0 ? retina_at(eye, cardinal_points(eye, 589.3).image_focal_mm)
                : retina_at(eye, bennett_rabbetts(0).axial_length_mm());
}

struct Schematic {
  const char* name;
  EyeModel (*make)(double parameter);
  /// Largest value of the model's own accommodation parameter, 0 at rest; 0 for a model that does not
  /// accommodate.
  double largest_parameter;
};

// A new schematic eye: its function above and one line here.
constexpr Schematic schematics[] = {{"gullstrand", gullstrand, 10.87013},
                                    {"gullstrand-emsley", gullstrand_emsley, 1},
                                    {"le-grand", le_grand, 1},
                                    {"navarro", navarro, 12},
                                    {"escudero-sanz-navarro", escudero_sanz_navarro, 0},
                                    {"liou-brennan", liou_brennan, 0},
                                    {"arizona", arizona, 12},
                                    {"bennett-rabbetts", bennett_rabbetts, 10}};

constexpr const char* atchison_prefix = "atchison";

const Schematic* find_schematic(const std::string& name) {
  for (const Schematic& schematic : schematics)
    if (name == schematic.name) return &schematic;
  return nullptr;
}

bool is_atchison(const std::string& name) {
  return name == atchison_prefix || name.rfind(std::string(atchison_prefix) + ":", 0) == 0;
}

EyeModel make_atchison(const std::string& name) {
  double spectacle_D = 0;
  if (name != atchison_prefix) {
    std::string_view text = std::string_view(name).substr(name.find(':') + 1);
    if (!text.empty() && text.front() == '+') text.remove_prefix(1);
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), spectacle_D);
    if (text.empty() || status != std::errc{} || end != text.data() + text.size())
      throw usage_error("eye '" + name + "': expected a spectacle refraction in dioptres after the colon",
                        "write atchison:-4, say");
  }
  if (!(spectacle_D >= -20 && spectacle_D <= 10))
    throw usage_error("eye '" + name + "': the model is for spectacle refractions from -20 to +10 D");
  EyeModel eye = atchison(spectacle_D);
  eye.name = name;
  return eye;
}

double refraction_D(const EyeModel& eye) { return paraxial_refraction(eye, eye.reference_wavelength_nm).M_D; }

/// The model's own parameter for a change of refraction, by bisection: refraction falls as the parameter
/// grows.
double parameter_for(const Schematic& schematic, double accommodation_D) {
  const double target_D = refraction_D(schematic.make(0)) - accommodation_D;
  double low = 0, high = schematic.largest_parameter;
  // Published end points are rounded to hundredths of a dioptre: half of one beyond the last state is still
  // it.
  const double reached_D = refraction_D(schematic.make(high));
  if (target_D < reached_D) {
    if (target_D < reached_D - 0.005)
      throw usage_error("--accommodation " + std::to_string(accommodation_D) + ": the " + schematic.name +
                        " eye accommodates by " + std::to_string(target_D + accommodation_D - reached_D) +
                        " D at most");
    return high;
  }
  for (int k = 0; k < 60; ++k) {
    const double middle = (low + high) / 2;
    (refraction_D(schematic.make(middle)) > target_D ? low : high) = middle;
  }
  return (low + high) / 2;
}

EyeModel make_schematic(const Schematic& schematic, const EyeOptions& options) {
  const bool asked = options.accommodation_D != 0 || options.accommodation_parameter.value_or(0) != 0;
  if (asked && schematic.largest_parameter == 0)
    throw unsupported_error(std::string("the ") + schematic.name + " eye has no accommodation");
  if (options.accommodation_D < 0)
    throw usage_error(
        fmt::format("--accommodation {:g}: an eye at rest accommodates by 0 D", options.accommodation_D),
        "give 0 or more");
  if (!options.accommodation_parameter)
    return schematic.make(options.accommodation_D == 0 ? 0
                                                       : parameter_for(schematic, options.accommodation_D));
  const double parameter = *options.accommodation_parameter;
  if (!(parameter >= 0 && parameter <= schematic.largest_parameter))
    throw usage_error("--accommodation-parameter " + std::to_string(parameter) + ": the " + schematic.name +
                      " eye's parameter goes from 0 to " + std::to_string(schematic.largest_parameter));
  return schematic.make(parameter);
}

/// A file "navarro" without an ending would stand in the way of the eye: it is read as "./navarro".
bool names_a_file(const std::string& text) {
  const std::filesystem::path path(text);
  const std::string ending = path.extension().string();
  const bool is_a_name = find_schematic(text) != nullptr || is_atchison(text);
  return ending == ".json" || ending == ".zmx" || ending == ".ZMX" || (!is_a_name && is_file(text));
}

}  // namespace

std::vector<std::string> schematic_eye_names() {
  std::vector<std::string> names;
  for (const Schematic& schematic : schematics) names.emplace_back(schematic.name);
  names.emplace_back("atchison:-4");
  return names;
}

bool is_schematic_eye(const std::string& name_or_file) {
  return !names_a_file(name_or_file) &&
         (find_schematic(name_or_file) != nullptr || is_atchison(name_or_file));
}

EyeModel make_eye(const std::string& name_or_file, const EyeOptions& options) {
  if (options.accommodation_D != 0 && options.accommodation_parameter)
    throw usage_error("--accommodation and --accommodation-parameter exclude each other");
  if (!std::isfinite(options.accommodation_D) || !std::isfinite(options.accommodation_parameter.value_or(0)))
    throw usage_error("--accommodation must be a finite number");
  if (options.pupil_mm && !(*options.pupil_mm > 0 && *options.pupil_mm <= 20))
    throw usage_error("--pupil must be greater than 0 and at most 20 mm");
  const bool accommodated = options.accommodation_D != 0 || options.accommodation_parameter.value_or(0) != 0;
  EyeModel eye;
  if (names_a_file(name_or_file)) {
    eye = read_eye_file(name_or_file);
    if (accommodated) throw unsupported_error(name_or_file + ": an eye from a file has no accommodation");
    if (options.pupil_mm && eye.stop() == nullptr)
      throw input_error(name_or_file + ": --pupil was given, but the eye has no surface of type \"stop\"");
  } else if (const Schematic* schematic = find_schematic(name_or_file)) {
    eye = make_schematic(*schematic, options);
  } else if (is_atchison(name_or_file)) {
    if (accommodated) throw unsupported_error("the atchison eye has no accommodation");
    eye = make_atchison(name_or_file);
  } else {
    std::string known;
    for (const std::string& name : schematic_eye_names()) known += " " + name;
    throw usage_error("'" + name_or_file + "' is neither a schematic eye nor a file",
                      "the schematic eyes are" + known);
  }
  if (options.pupil_mm) eye.set_stop_diameter(*options.pupil_mm);
  if (options.laterality == Laterality::os && is_schematic_eye(name_or_file))
    eye.surface("iris").decentre_mm.x() *= -1;
  return eye;
}

}  // namespace emmetrope
