#include <charconv>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::raytrace {
namespace {

const char* const form =
    "write S/CxA@V[,key=value...], such as -2.25/-1.00x180@12,base_D=5,prism=2@90; without @V it stands at "
    "12 mm";

/// What is left to read of the option's text.
class Reader {
 public:
  explicit Reader(const std::string& text) : whole_(text), rest_(text) {}

  bool done() const { return rest_.empty(); }
  bool take(char expected) {
    if (rest_.empty() || rest_.front() != expected) return false;
    rest_.remove_prefix(1);
    return true;
  }
  void need(char expected) {
    if (!take(expected)) throw fault(std::string("'") + expected + "' is missing");
  }
  double number() {
    take('+');
    double value = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc() || !std::isfinite(value)) throw fault("a number is missing");
    rest_.remove_prefix(end - rest_.data());
    return value;
  }
  std::string key() {
    const std::size_t equals = rest_.find('=');
    if (equals == std::string_view::npos) throw fault("key=value is missing");
    const std::string name(rest_.substr(0, equals));
    rest_.remove_prefix(equals + 1);
    return name;
  }
  Error fault(const std::string& what) const {
    return usage_error("--spectacle: \"" + whole_ + "\": " + what, form);
  }

 private:
  std::string whole_;
  std::string_view rest_;
};

void read_keys(Reader& reader, Meniscus& lens, bool& real) {
  while (!reader.done()) {
    reader.need(',');
    const std::string key = reader.key();
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
    } else {
      throw reader.fault("unknown key \"" + key +
                         "\"; known: base_D, thickness_mm, semi_diameter_mm, index, abbe, prism");
    }
  }
}

}  // namespace

EyeModel with_spectacle(const EyeModel& eye, const std::string& text) {
  if (std::filesystem::path(text).extension() == ".json") return with_surfaces_of(eye, text);
  Reader reader(text);
  SpheroCylinder power;
  Meniscus lens;
  bool real = false;  // any key of a ground lens makes it one
  power.sphere_D = reader.number();
  if (reader.take('/')) {
    power.cylinder_D = reader.number();
    reader.need('x');
    power.axis_deg = reader.number();
  }
  if (std::abs(power.sphere_D) > 40 || std::abs(power.cylinder_D) > 40)
    throw reader.fault("sphere and cylinder must be -40 to 40 D");
  if (!(power.axis_deg >= 0 && power.axis_deg <= 180))
    throw reader.fault("the axis must be 0 to 180 degrees");
  if (reader.take('@')) lens.vertex_distance_mm = reader.number();
  if (!(lens.vertex_distance_mm > 0 && lens.vertex_distance_mm <= 50))
    throw reader.fault("the vertex distance must be above 0 and at most 50 mm");
  read_keys(reader, lens, real);
  lens.power = to_power_vector(power);
  return real ? with_meniscus(eye, lens)
              : with_thin_lens(eye, lens.power, lens.vertex_distance_mm, lens.prism);
}

}  // namespace emmetrope::raytrace
