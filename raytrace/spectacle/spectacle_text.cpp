#include <algorithm>
#include <cmath>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/notation.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/spectacle/text_reader.hpp"

namespace emmetrope::raytrace {
namespace {

const char* const form =
    "write S/CxA@V[,key=value...], such as -2.25/-1.00x180@12,base_D=5,prism=2@90; without @V it stands at "
    "12 mm";

/// Reads the keys behind the prescription, or says what is wrong with the text.
class LensReader {
 public:
  /// \param keys  the end of `whole`
  LensReader(const std::string& whole, std::string_view keys) : whole_(whole), rest_(keys) {}

  bool done() const { return rest_.done(); }
  void need(char expected) {
    if (!rest_.take(expected)) throw fault(std::string("'") + expected + "' is missing");
  }
  double number() {
    if (const auto value = rest_.number()) return *value;
    throw fault("a number is missing");
  }
  std::string key() {
    if (const auto name = rest_.until('=')) return std::string(*name);
    throw fault("key=value is missing");
  }
  Error fault(const std::string& what, const std::string& remedy = form) const {
    return usage_error("--spectacle: \"" + whole_ + "\": " + what, remedy);
  }

 private:
  const std::string& whole_;
  TextReader rest_;
};

StatedRefraction prescription_in(const std::string& text) {
  try {
    return parse_refraction(text);
  } catch (const Error& error) {
    throw Error(error.status(), std::string("--spectacle: ") + error.what(), error.remedy());
  }
}

void read_keys(LensReader& reader, Meniscus& lens, bool& real) {
  std::set<std::string> given;
  while (!reader.done()) {
    reader.need(',');
    const std::string key = reader.key();
    if (!given.insert(key).second)
      throw reader.fault(key + " is given twice",
                         key == "prism" ? "two prisms are one, added as arrows: write 2@90 and 2@0 as 2.83@45"
                                        : "give it once");
    const double value = reader.number();
    const auto check = [&](bool good, const char* range) {
      if (!good) throw reader.fault(key + " must be " + range);
    };
    real |= key != "prism";
    if (key == "base_D") {
      lens.base_D = value;
      check(std::abs(value) <= 20, "-20 to 20");
    } else if (key == "thickness_mm") {
      lens.centre_thickness_mm = value;
      check(value > 0 && value <= 20, "above 0 and at most 20");
    } else if (key == "semi_diameter_mm") {
      lens.semi_diameter_mm = value;
      check(value >= 5 && value <= 50, "5 to 50");
    } else if (key == "index") {
      lens.index = value;
      check(value >= 1.3 && value <= 2.5, "1.3 to 2.5");
    } else if (key == "abbe") {
      lens.abbe = value;
      check(value >= 10 && value <= 100, "10 to 100");
    } else if (key == "prism") {
      lens.prism.dioptres = value;
      check(value >= 0 && value <= 30, "0 to 30, with its base: 2@90");
      reader.need('@');
      lens.prism.base_deg = reader.number();
      if (!(lens.prism.base_deg >= 0 && lens.prism.base_deg <= 360))
        throw reader.fault("the base of prism must be 0 to 360 degrees");
    } else {
      throw reader.fault("unknown key \"" + key +
                         "\"; known: base_D, thickness_mm, semi_diameter_mm, index, abbe, prism");
    }
  }
}

}  // namespace

Spectacle parse_spectacle(const std::string& text) {
  if (std::filesystem::path(text).extension() == ".json") return SurfacesFile{text};
  std::string compact = text;
  compact.erase(std::remove(compact.begin(), compact.end(), ' '), compact.end());
  const std::size_t keys_begin = std::min(compact.find(','), compact.size());
  LensReader reader(compact, std::string_view(compact).substr(keys_begin));
  const StatedRefraction stated = prescription_in(compact.substr(0, keys_begin));
  if (stated.sigma_D) throw reader.fault("a lens has no accuracy", "leave +- and what follows it out");
  if (stated.vertex_distance_mm == 0)
    throw reader.fault("a spectacle does not stand on the cornea",
                       "write @5 to @30; a contact lens is a file of surfaces");
  Meniscus lens;
  lens.power = to_power_vector(stated.refraction);
  lens.vertex_distance_mm = stated.vertex_distance_mm;
  bool real = false;  // any key of a ground lens makes it one
  read_keys(reader, lens, real);
  if (real) return lens;
  return ThinLens{lens.power, lens.vertex_distance_mm, lens.prism};
}

namespace {

Json to_json(const PowerVector& power) {
  return {{"M_D", power.M_D}, {"J0_D", power.J0_D}, {"J45_D", power.J45_D}};
}
Json to_json(const Prism& prism) { return {{"dioptres", prism.dioptres}, {"base_deg", prism.base_deg}}; }

struct SpectacleJson {
  Json operator()(const ThinLens& lens) const {
    return {{"power", to_json(lens.power)},
            {"vertex_distance_mm", lens.vertex_distance_mm},
            {"prism", to_json(lens.prism)}};
  }
  Json operator()(const Meniscus& lens) const {
    Json json = (*this)(ThinLens{lens.power, lens.vertex_distance_mm, lens.prism});
    json["base_D"] = lens.base_D;
    json["thickness_mm"] = lens.centre_thickness_mm ? Json(*lens.centre_thickness_mm) : Json(nullptr);
    json["semi_diameter_mm"] = lens.semi_diameter_mm;
    json["index"] = lens.index;
    json["abbe"] = lens.abbe ? Json(*lens.abbe) : Json(nullptr);
    return json;
  }
  Json operator()(const PlanoCylinder& lens) const {
    return {{"radius_mm", lens.radius_mm}, {"axis_deg", lens.axis_deg}};
  }
  Json operator()(const SurfacesFile& surfaces) const { return surfaces.file.string(); }
};

}  // namespace

Json to_json(const Spectacle& spectacle) { return std::visit(SpectacleJson(), spectacle); }

}  // namespace emmetrope::raytrace
