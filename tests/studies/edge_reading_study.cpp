/// Reads the eyes of studies by half-level edges and prints what it read.
#include <fmt/format.h>

#include <filesystem>
#include "pipeline/base/files.hpp"
#include "segmentation/edges/edge_reader.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/intake/study.hpp"
#include "segmentation/study_input.hpp"

using namespace emmetrope;
using namespace emmetrope::segmentation;

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    try {
      IntakeOptions intake;
      const StudyInventory inventory = read_inventory(argv[i], intake);
      const auto series = choose_series(inventory, {});
      std::vector<Stack> volumes;
      std::vector<std::string> tags;
      for (const SeriesInfo* info : series) {
        volumes.push_back(read_series(inventory, info->uid, intake));
        tags.push_back(info->image_laterality);
      }
      std::vector<const Stack*> stacks;
      for (const Stack& v : volumes) stacks.push_back(&v);
      const FoundEyes found = find_eyes(stacks, tags);
      fmt::print("{}\n", argv[i]);
      for (const FoundEye& eye : found.eyes) {
        for (const EyeView& view : eye.views) {
          const auto r = read_edges(*stacks[view.stack], {view.globe.centre, eye.axis}, eye.weighting);
          if (!r) {
            fmt::print("  {} nothing\n", to_string(eye.laterality));
            continue;
          }
          const Eigen::Vector3d c = r->globe.centre, l = r->lens_centre, s = 2 * r->globe.half_axes;
          fmt::print(
              "  {} {} centre {:7.2f} {:7.2f} {:7.2f} lens {:7.2f} {:7.2f} {:7.2f} d {:.2f} width {:.2f} height {:.2f} depth {:.2f} kept {:.2f} edge {:.2f} in {:.2f} rms {:.2f} rule {:.2f} contrast {:.2f} void {:.2f} wider {:.2f} higher {:.2f}",
              to_string(eye.laterality), to_string(eye.weighting), c.x(), c.y(), c.z(), l.x(), l.y(), l.z(),
              r->lens_to_centre_mm(), s.x(), s.y(), s.z(), r->globe.kept_share, r->rays_with_edge,
              r->rays_inside, r->globe.rms_mm, r->rule_spread_mm, r->wall_contrast, r->rays_over_void,
              r->wider_mm, r->higher_mm);
          const std::filesystem::path truth = std::filesystem::path(argv[i]).parent_path() / "truth.json";
          if (std::filesystem::exists(truth)) {
            const Json t = read_json(truth)["eyes"][to_string(eye.laterality)];
            Eigen::Vector3d tc;
            for (int k = 0; k < 3; ++k) tc[k] = t["globe_centre_lps_mm"][k].get<double>();
            fmt::print(" ERR centre {:.2f} width {:+.2f} height {:+.2f} ", (c - tc).norm(),
                       s.x() - t["globe_width_mm"].get<double>(), s.y() - t["globe_height_mm"].get<double>());
            if (r->axial)
              fmt::print(
                  "length {:+.2f} acd {:+.2f} lens {:+.2f}",
                  r->axial->inner_cornea_mm - r->axial->inner_wall_mm + 0.54 -
                      t["axial_length_mm"].get<double>(),
                  r->axial->inner_cornea_mm - r->axial->lens_front_mm + 0.54 -
                      t["anterior_chamber_depth_mm"].get<double>(),
                  r->axial->lens_front_mm - r->axial->lens_back_mm - t["lens_thickness_mm"].get<double>());
          }
          if (r->axial)
            fmt::print(" | len {:.2f} lens {:.2f}..{:.2f} cornea {:.2f} back {:.2f}\n",
                       r->axial->inner_cornea_mm - r->axial->inner_wall_mm, r->axial->lens_back_mm,
                       r->axial->lens_front_mm, r->axial->inner_cornea_mm, r->axial->inner_wall_mm);
          else
            fmt::print(" | no axis\n");
        }
      }
    } catch (const std::exception& e) {
      fmt::print("{}: {}\n", argv[i], e.what());
    }
  }
}
