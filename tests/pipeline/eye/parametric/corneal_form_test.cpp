// A cornea with a free form, from the fitted numbers to meshes and biometry.
#include <gtest/gtest.h>

#include <cmath>

#include "meshing/biometry.hpp"
#include "meshing/optics.hpp"
#include "meshing/remesh.hpp"
#include "meshing/sheet.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/instruments/topography.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope {
namespace {

using namespace meshing;

constexpr int trefoil = 3;  ///< term of the free form: OSA 9

ParametricEye irregular_eye(unsigned seed) {
  ParametricEye eye = random_eye(seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (int i = 0; i < corneal_form_terms; ++i)
    eye.cornea_zernike_um[i] = std::ldexp(6, 3 - zernike_index(corneal_form_first + i).n) * normal(random);
  eye.cornea_back_form_ratio = 1.8;
  const auto knows = [&](const std::string& name, double sigma) {
    const Eigen::Index n = eye.covariance.rows();
    eye.parameter_names.push_back(name);
    eye.source[name] = "mri";
    eye.covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(n + 1, n + 1));
    eye.covariance(n, n) = sigma * sigma;
  };
  for (int i = 0; i < corneal_form_terms; ++i) knows(corneal_form_name(i), i == trefoil ? 1 : 1e-3);
  knows("cornea_back_form_ratio", 0.4);
  return eye;
}

TEST(CornealForm, GradientIsThatOfTheTermsAndTheApexStays) {
  for (const double value : corneal_form(0, 0).value) EXPECT_NEAR(value, 0, 1e-15);
  constexpr double h = 1e-5;
  for (const auto& [x, y] : {std::pair{1.2, -0.7}, {-3.1, 2.9}, {0.0, 5.2}, {6.5, -1.0}, {-4.0, -6.0}}) {
    const CornealForm at = corneal_form(x, y), right = corneal_form(x + h, y), left = corneal_form(x - h, y),
                      above = corneal_form(x, y + h), below = corneal_form(x, y - h);
    for (int i = 0; i < corneal_form_terms; ++i) {
      EXPECT_NEAR(at.gradient_per_mm[i].x(), (right.value[i] - left.value[i]) / (2 * h), 1e-6) << i;
      EXPECT_NEAR(at.gradient_per_mm[i].y(), (above.value[i] - below.value[i]) / (2 * h), 1e-6) << i;
    }
  }
  // Far away it stays what it is where the cornea ends.
  EXPECT_NEAR(corneal_form(30, 40).value[7], corneal_form(3.6, 4.8).value[7], 1e-12);
}

TEST(IrregularCornea, JsonKeepsItsTermsAndNamesThem) {
  const ParametricEye eye = irregular_eye(3);
  const Json json = to_json(eye);
  const ParametricEye back = parametric_eye_from_json(Json::parse(json.dump()));
  EXPECT_EQ(to_json(back), json);
  EXPECT_EQ(back.cornea_zernike_um, eye.cornea_zernike_um);
  EXPECT_EQ(back.get("cornea_zernike_07_um"), eye.cornea_zernike_um[1]);
  EXPECT_EQ(back.get("cornea_zernike_35_um"), eye.cornea_zernike_um[29]);
  EXPECT_FALSE(has_parameter(eye, "cornea_zernike_36_um"));
}

TEST(IrregularCornea, ShapesAndMeshesAreThoseOfTheFit) {
  const ParametricEye eye = irregular_eye(4);
  const auto surfaces = analytic_surfaces(eye);
  for (const double x : {-4.1, 0.0, 2.3})
    for (const double y : {-3.0, 0.8, 3.9}) {
      EXPECT_NEAR(*surfaces[0].shape->depth_mm(x, y), eye.cornea_anterior_depth_mm(x, y), 1e-12);
      EXPECT_NEAR(eye.cornea_thickness_mm + *surfaces[1].shape->depth_mm(x, y),
                  eye.cornea_posterior_depth_mm(x, y), 1e-12);
    }
  for (const NamedSheet& named : make_sheets(eye)) {
    if (named.name.rfind("cornea", 0) != 0) continue;
    const bool front = named.name == "cornea_anterior";
    const auto depth = [&](double x, double y) {
      return front ? eye.cornea_anterior_depth_mm(x, y) : eye.cornea_posterior_depth_mm(x, y);
    };
    const TriangleMesh mesh = mesh_with_vertices(*named.sheet, 300);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      const Eigen::Vector3d& v = mesh.vertices[i];
      EXPECT_NEAR(v.z(), -depth(v.x(), v.y()), 1e-10);
      if (v.head<2>().norm() > 5.4) continue;
      constexpr double h = 1e-5;
      const Eigen::Vector3d normal((depth(v.x() + h, v.y()) - depth(v.x() - h, v.y())) / (2 * h),
                                   (depth(v.x(), v.y() + h) - depth(v.x(), v.y() - h)) / (2 * h), 1);
      EXPECT_LT((mesh.normals[i] - normal.normalized()).norm(), 1e-6);
    }
  }
}

/// Trefoil over 4.5 mm is (3 / 4.5)^3 of it over 3 mm, and no toric conicoid has any.
TEST(IrregularCornea, IrregularityOfTrefoilIsItsRms) {
  ParametricEye eye;
  eye.cornea_q = -0.3;
  eye.cornea_zernike_um[trefoil] = 10;
  EXPECT_NEAR(irregularity_um(anterior_cornea(eye)), 10 * std::pow(3 / 4.5, 3), 0.02);
  eye.cornea_zernike_um[trefoil] = 0;
  EXPECT_NEAR(irregularity_um(anterior_cornea(eye)), 0, 0.01);
}

TEST(IrregularCornea, BiometryTellsItFromTheImages) {
  ParametricEye eye = irregular_eye(6);
  eye.cornea_zernike_um.fill(0);
  eye.cornea_zernike_um[trefoil] = 10;
  const UncertainEye estimate = fitted_eye(eye);
  const Json json = biometry_json(estimate, {});
  const Measured irregularity = json["astigmatism"]["irregularity_um"].get<Measured>();
  EXPECT_EQ(irregularity.source, "mri");
  EXPECT_NEAR(irregularity.value, 2.96, 0.05);
  // One micrometre of the term.
  EXPECT_NEAR(irregularity.sigma(), std::pow(3 / 4.5, 3), 0.02);
  // Height, not depth, over 6 mm.
  EXPECT_NEAR(json["cornea_zernike_um"][9]["value"].get<double>(), -2.96, 0.05);

  const Json optics = optics_json(estimate, {});
  const auto names = optics["parameters"].get<std::vector<std::string>>();
  EXPECT_EQ(std::count(names.begin(), names.end(), "cornea_zernike_09_um"), 1);
  EXPECT_EQ(optics["eye"]["surfaces"][0]["type"], "zernike");
}

/// A topographer's map replaces the form: what stays of the images' cornea is its best toric conicoid, to
/// which trefoil adds nothing.
TEST(IrregularCornea, TopographyTakesTheFormsPlace) {
  ParametricEye regular;
  regular.cornea_j0_per_mm = 0.003;
  ParametricEye irregular = regular;
  irregular.cornea_zernike_um[trefoil] = 10;
  Topography map;
  map.zone_mm = 8;
  map.departure_um = Eigen::VectorXd::Zero(28);
  map.departure_um[8] = 3;
  const CornealDepth with = anterior_cornea(irregular, map), without = anterior_cornea(regular, map);
  const ShapePtr shape = anterior_cornea_shape(irregular, map);
  for (const double x : {-2.5, 0.0, 1.8})
    for (const double y : {-1.9, 0.6, 2.2}) {
      EXPECT_NEAR(with(x, y), without(x, y), 2e-4);
      EXPECT_NEAR(*shape->depth_mm(x, y), with(x, y), 1e-9);
    }
}

}  // namespace
}  // namespace emmetrope
