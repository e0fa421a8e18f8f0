#include <CLI/CLI.hpp>
#include <algorithm>

#include "data_samples/phantom/acquisition.hpp"
#include "data_samples/phantom/anatomy.hpp"
#include "data_samples/phantom/geometry.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/movement/movement.hpp"
#include "raytrace/scene/chart.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "segmentation/intake/series_choice.hpp"
#include "segmentation/intake/subject.hpp"
#include "tests/fuzz/door_groups.hpp"

namespace emmetrope::fuzz {
namespace {

namespace fs = std::filesystem;

void read_instrument_options(const std::string& text) {
  for (const auto option : {&InstrumentFlags::keratometry, &InstrumentFlags::axial_length,
                            &InstrumentFlags::anterior_chamber_depth, &InstrumentFlags::lens_thickness,
                            &InstrumentFlags::topography}) {
    InstrumentFlags flags;
    (flags.*option).push_back(text);
    try {
      parse_instruments(flags, 0.2);
    } catch (const Error&) {  // the text is another option's, or no one's
    }
  }
}

void make_stack(const std::string& text) {
  static const phantom::Anatomy anatomy(phantom::sample_head());
  phantom::make_stack(text, anatomy);
}

Door option_door(const std::string& name, std::vector<std::string> seeds,
                 std::function<void(const std::string&)> open) {
  return {name, "value.txt", [seeds = std::move(seeds)](const fs::path&) { return seeds; }, mutate_text,
          [open = std::move(open)](const fs::path& file) {
            std::string text = read_file(file);
            text.erase(std::remove(text.begin(), text.end(), '\0'), text.end());
            open(text);
          }};
}

}  // namespace

std::vector<Door> option_doors() {
  return {
      option_door("instruments",
                  {"od:43.25@175/44.75@85+-0.25", "os:23.60+-0.05", "od:3.4", "both:/tmp/map.csv+-0.1"},
                  read_instrument_options),
      option_door("refraction", {"-2.25/-1.00x180@12+-0.25", "+1.50 DS", "PL", "+1.5@14"},
                  [](const std::string& text) { parse_refraction(text); }),
      option_door("chart", {"letters:logmar=0.3,distance_mm=6000", "siemens:spokes=36,contrast=0.5"},
                  [](const std::string& text) { raytrace::parse_chart(text); }),
      option_door("eye", {"navarro", "atchison:-4", "gullstrand", "escudero-sanz-navarro"},
                  [](const std::string& text) { make_eye(text); }),
      option_door(
          "spectacle",
          {"-2.00/-1.00x90@12", "-3/0x0@12,base_D=5,prism=2@90", "+1.25/-0.50x5@14,base_D=6,index=1.6"},
          [](const std::string& text) { raytrace::parse_spectacle(text); }),
      option_door("movement",
                  {"saccade:amplitude_deg=8,direction_deg=90", "fixation", "drift:diffusion_arcmin2_s=40"},
                  [](const std::string& text) { raytrace::make_movement(text, 1); }),
      option_door("series", {"1.2.840.113619.2.1", "2", "1.2.3,EchoTime=91"},
                  [](const std::string& text) { segmentation::parse_series_choice(text); }),
      option_door("age", {"026Y", "018M", "100D"},
                  [](const std::string& text) { segmentation::parse_age_years(text); }),
      option_door(
          "stack",
          {"od-coronal:pixel_mm=0.4,slice_mm=2,gap_mm=0,matrix=192x160,slices=16,tilt_deg=4/-3,contrast=t2,"
           "profile=box,coil=surface,acquired=1x0.8",
           "head-axial:pixel_mm=1,slice_mm=1,matrix=140x60,slices=44"},
          make_stack),
      option_door("head", {"age_years=40,roll_deg=2", "interpupillary_distance_mm=62"},
                  [](const std::string& text) {
                    phantom::HeadGeometry head = phantom::sample_head();
                    phantom::set_fields(head, text);
                    phantom::check(head);
                  }),
  };
}

}  // namespace emmetrope::fuzz
