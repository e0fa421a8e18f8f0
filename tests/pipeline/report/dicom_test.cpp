#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmrt/drtstrct.h>

#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/report/dicom/plane_cut.hpp"
#include "pipeline/report/dicom/write_objects.hpp"
#include "tests/pipeline/report/report_fixture.hpp"

// The DICOM objects, read back by other programs: dciodvfy and dcmdump.

namespace emmetrope::report {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class DicomTest : public ReportTest {
 protected:
  /// The fixture's case, and beside it the study that it was made from.
  fs::path make_case_and_study() const {
    test::make_fixture_case(folder_);
    fs::path study = folder_.string() + "-study";
    fs::remove_all(study);
    test::make_fixture_study(study);
    test::note_study(folder_, study);
    return study;
  }
  /// The bytes of an object's element of this kind (OB, explicit little endian).
  std::string bytes_of(const std::string& name, std::uint16_t group, std::uint16_t element) const {
    const std::string object = output(name);
    std::string tag(8, '\0');
    std::memcpy(tag.data(), &group, 2);
    std::memcpy(tag.data() + 2, &element, 2);
    std::memcpy(tag.data() + 4, "OB", 2);
    const std::size_t at = object.find(tag);
    std::uint32_t length = 0;
    if (at == std::string::npos || at + 12 > object.size()) return {};
    std::memcpy(&length, object.data() + at + 8, 4);
    return object.substr(at + 12, length);
  }

  void expect_the_pdf() const;
  void expect_the_lenses() const;
  void expect_a_note_of_axes_that_are_none() const;
  void expect_coded_segments() const;
  void expect_every_labelled_voxel() const;
  void expect_the_mesh() const;
  void expect_the_picture() const;
};

TEST_F(DicomTest, EveryObjectConforms) {
  test::make_fixture_case(folder_);
  const fs::path study = folder_ / "study";
  test::make_fixture_study(study);
  test::note_study(folder_, study);
  report(study);
  int objects = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "report")) {
    if (entry.path().extension() != ".dcm") continue;
    ++objects;
    // dciodvfy writes to standard error.
    const std::string found =
        run_process("/bin/sh", {"-c", "dciodvfy \"$1\" 2>&1", "sh", entry.path().string()},
                    ChildOutput::capture)
            .output;
    std::istringstream lines(found);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("Error", 0) != 0) continue;
      // Its table for this SOP class demands the clinical trial modules, which are optional.
      const bool is_known =
          entry.path().filename() == "prescription.dcm" && line.find("ClinicalTrial") != std::string::npos;
      EXPECT_TRUE(is_known) << entry.path().filename() << ": " << line;
    }
  }
  EXPECT_EQ(objects, 5 + 10 + 4);
}

TEST_F(DicomTest, ObjectsBelongToThePatientsStudy) {
  const fs::path study = make_case_and_study();
  report(study);
  for (const char* name : {"report.dcm", "prescription.dcm", "biometry.dcm", "segmentation.dcm",
                           "structures.dcm", "dicom/od_retina.dcm"}) {
    const std::string object = dump(name);
    EXPECT_THAT(object, HasSubstr("[DOE^JANE]")) << name;
    EXPECT_THAT(object, HasSubstr("[1.2.826.0.1.3680043.10.1.1]")) << name;  // the study
    EXPECT_THAT(object, Not(HasSubstr("[1.2.826.0.1.3680043.10.1.2]\n"))) << name;
    EXPECT_THAT(object, HasSubstr("1.2.826.0.1.3680043.10.1.3.7")) << name;  // a source image
  }
  const std::string html =
      visible_text(output("report.html"));  // a picture's base64 may hold any three letters
  EXPECT_THAT(html, Not(HasSubstr("DOE")));
  EXPECT_THAT(html, Not(HasSubstr("1961")));
  EXPECT_THAT(html, Not(HasSubstr("MRN-4711")));
  EXPECT_THAT(pdf_text(), Not(HasSubstr("DOE")));
  EXPECT_THAT(output("stage.json"), Not(HasSubstr("DOE")));
  EXPECT_THAT(output("prescription.fhir.json"), Not(HasSubstr("DOE")));

  report(study, true);
  EXPECT_THAT(pdf_text(), HasSubstr("JANE DOE"));
  EXPECT_THAT(pdf_text(), HasSubstr("1961-02-03"));
  EXPECT_THAT(dump("report.dcm"), HasSubstr("[YES]"));
  EXPECT_THAT(output("stage.json"), Not(HasSubstr("DOE")));
  fs::remove_all(study);
}

/// Corners of a structure's outlines, LPS mm, an outline an image.
std::vector<std::vector<Eigen::Vector3d>> outlines_of(DRTStructureSetIOD& structures, std::size_t region) {
  std::vector<std::vector<Eigen::Vector3d>> outlines;
  DRTContourSequence& slices = structures.getROIContourSequence().getItem(region).getContourSequence();
  for (std::size_t slice = 0; slice < slices.getNumberOfItems(); ++slice) {
    OFVector<Float64> numbers;
    slices.getItem(slice).getContourData(numbers);
    auto& outline = outlines.emplace_back();
    for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
      outline.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  }
  return outlines;
}

TEST_F(DicomTest, StructureSetOutlinesTheEyesOnTheirImages) {
  const fs::path study = make_case_and_study();
  report(study);
  const fs::path file = folder_ / "report" / "structures.dcm";
  DcmFileFormat format;
  ASSERT_TRUE(format.loadFile(file.c_str()).good());
  DRTStructureSetIOD structures;
  ASSERT_TRUE(structures.read(*format.getDataset()).good());
  std::vector<std::string> names;
  DRTStructureSetROISequence& regions = structures.getStructureSetROISequence();
  for (std::size_t i = 0; i < regions.getNumberOfItems(); ++i) {
    OFString name;
    regions.getItem(i).getROIName(name);
    names.emplace_back(name.c_str());
  }
  EXPECT_THAT(names, ::testing::ElementsAre("Eye_inner_R", "Lens_R", "Eye_inner_L", "Lens_L"));

  // Every point lies in a plane of the images, and but for the straight parts on one of the meshes: on Eye_inner_R the retina.
  const TriangleMesh retina = read_mesh(folder_ / "meshing" / "od" / "retina.ply").mesh;
  const TriangleMesh cornea = read_mesh(folder_ / "meshing" / "od" / "cornea_anterior.ply").mesh;
  ASSERT_EQ(structures.getROIContourSequence().getNumberOfItems(), names.size());
  const auto outlines = outlines_of(structures, 0);
  EXPECT_GT(outlines.size(), 5U);
  const auto by_y = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return a.y() < b.y(); };
  const double cornea_ends_y =
                   std::max_element(cornea.vertices.begin(), cornea.vertices.end(), by_y)->y() - 0.5,
               retina_begins_y =
                   std::min_element(retina.vertices.begin(), retina.vertices.end(), by_y)->y() + 0.5;
  ASSERT_GT(retina_begins_y, cornea_ends_y + 2);
  // Without the wall it is no eyeball, and no organ whose dose a planner would ask for.
  const std::string dumped = dump("structures.dcm");
  EXPECT_THAT(dumped, AllOf(HasSubstr("[EYE_INNER]"), HasSubstr("[CAVITY]"),
                            HasSubstr("Without retina, choroid and sclera")));
  EXPECT_THAT(dumped, Not(HasSubstr("79652003")));
  for (const auto& outline : outlines) {
    ASSERT_GE(outline.size(), 3U);
    for (const Eigen::Vector3d& point : outline) {
      EXPECT_NEAR(point.z(), outline.front().z(), 1e-3);
      double least = 1e9;
      for (const TriangleMesh* mesh : {&retina, &cornea})
        for (const Eigen::Vector3d& vertex : mesh->vertices) least = std::min(least, (vertex - point).norm());
      // Within an edge of a triangle, or on the straight way from the cornea's rim (in front) to the retina's.
      if (least >= 1.5) {
        EXPECT_GT(point.y(), cornea_ends_y);
        EXPECT_LT(point.y(), retina_begins_y);
      }
    }
  }
  fs::remove_all(study);
}

// A point of a stack plus its shift lies where the surfaces are: on the images they lie that much lower.
TEST_F(DicomTest, StructuresFollowTheHeadsMotionBetweenStacks) {
  const fs::path study = make_case_and_study();
  const auto right_eye = [&] {
    report(study);
    DcmFileFormat format;
    DRTStructureSetIOD structures;
    EXPECT_TRUE(format.loadFile((folder_ / "report" / "structures.dcm").c_str()).good());
    EXPECT_TRUE(structures.read(*format.getDataset()).good());
    return outlines_of(structures, 0);
  };
  const auto still = right_eye();
  const fs::path file = folder_ / "segmentation" / "od" / "fit.json";
  Json fit = read_json(file);
  const Eigen::Vector3d shift(1.25, -0.5, 1.6);  // two slices down
  fit["stacks"] = {{{"name", "stack1"}, {"shift_lps_mm", {shift.x(), shift.y(), shift.z()}}}};
  write_json(file, fit);
  const auto moved = right_eye();
  ASSERT_EQ(moved.size(), still.size());
  for (std::size_t slice = 0; slice < still.size(); ++slice) {
    ASSERT_EQ(moved[slice].size(), still[slice].size());
    for (std::size_t i = 0; i < still[slice].size(); ++i)
      EXPECT_LT((moved[slice][i] - (still[slice][i] - shift)).norm(), 2e-3);  // three decimals are written
  }
  fs::remove_all(study);
}

// Those of a case are instances of one series, which viewers order by number.
TEST_F(DicomTest, StructureSetsOfTwoSeriesAreNumbered) {
  const fs::path study = make_case_and_study(), second = folder_ / "second";
  const char* second_series = "1.2.826.0.1.3680043.10.1.5";
  test::make_fixture_study(second);
  std::vector<std::string> words{"-nb", "-gin", "-m", std::string("(0020,000e)=") + second_series};
  for (const auto& entry : fs::directory_iterator(second)) words.push_back(entry.path().string());
  output_of("/usr/bin/dcmodify", words);
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(second)) {
    fs::copy_file(entry.path(), study / ("second-" + entry.path().filename().string()));
    ++files;
  }
  test::note_study(folder_, study);
  Json case_json = read_json(folder_ / "case.json");
  case_json["series"][0]["files"] = files;
  case_json["series"].push_back({{"uid", second_series}, {"files", files}});
  case_json["stacks"].push_back({{"uid", second_series}, {"name", "stack2"}, {"used", true}});
  write_json(folder_ / "case.json", case_json);
  report(study);
  EXPECT_THAT(dump("structures.dcm"), HasSubstr("(0020,0013) IS [1]"));
  EXPECT_THAT(dump("structures_2.dcm"), HasSubstr("(0020,0013) IS [2]"));
  fs::remove_all(study);
}

/// A cap of a sphere of radius 10 about the z axis, to an angle from its pole.
TriangleMesh cap_of_sphere(double sign, double widest_rad, int rings, int sectors) {
  TriangleMesh mesh;
  for (int ring = 0; ring <= rings; ++ring)
    for (int sector = 0; sector < sectors; ++sector) {
      const double theta = widest_rad * ring / rings, phi = 2 * pi * sector / sectors;
      mesh.vertices.push_back(10 * Eigen::Vector3d(std::sin(theta) * std::cos(phi),
                                                   std::sin(theta) * std::sin(phi), sign * std::cos(theta)));
    }
  for (int ring = 0; ring < rings; ++ring)
    for (int sector = 0; sector < sectors; ++sector) {
      const int a = ring * sectors + sector, b = ring * sectors + (sector + 1) % sectors;
      mesh.triangles.push_back({a, b, a + sectors});
      mesh.triangles.push_back({b, b + sectors, a + sectors});
    }
  return mesh;
}

TEST(PlaneCut, OfASphereInTwoSheetsIsACircle) {
  // Two caps that leave a belt of 2 mm out.
  const auto cap = [](double sign) { return cap_of_sphere(sign, std::acos(0.1), 60, 120); };
  const Eigen::Vector3d point(0.3, 3, 0.2), normal = Eigen::Vector3d(0.1, 1, 0.05).normalized();
  std::vector<Polyline> pieces;
  for (const double sign : {-1.0, 1.0})
    for (Polyline& piece : cut_by_plane(cap(sign), point, normal)) pieces.push_back(std::move(piece));
  ASSERT_EQ(pieces.size(), 2U);
  const Polyline outline = joined_outline(pieces);
  const double distance = point.dot(normal), radius = std::sqrt(100 - distance * distance);
  double length = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    EXPECT_NEAR((outline[i] - point).dot(normal), 0, 1e-9);
    EXPECT_NEAR((outline[i] - distance * normal).norm(), radius, 0.02);
    length += (outline[(i + 1) % outline.size()] - outline[i]).norm();
  }
  EXPECT_NEAR(length, 2 * 3.14159265358979 * radius, 0.1);
  EXPECT_TRUE(cut_by_plane(cap(1), Eigen::Vector3d(0, 11, 0), Eigen::Vector3d::UnitY()).empty());
  EXPECT_TRUE(joined_outline({}).empty());
}

/// Two sheets of a sphere with a wide belt between their rims, which the body spans straight.
TEST(PlaneCut, BetweenTheRimsTheBodyIsStraight) {
  std::vector<TriangleMesh> sheets{cap_of_sphere(1, pi / 3, 20, 120), cap_of_sphere(-1, pi / 3, 20, 90)};
  sheets.push_back(between_rims(sheets[0], sheets[1]));
  const auto area_mm2 = [&](const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
    std::vector<Polyline> pieces;
    for (const TriangleMesh& sheet : sheets)
      for (Polyline& piece : cut_by_plane(sheet, point, normal)) pieces.push_back(std::move(piece));
    const Polyline outline = joined_outline(std::move(pieces));
    Eigen::Vector3d twice = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < outline.size(); ++i)
      twice += outline[i].cross(outline[(i + 1) % outline.size()]);
    return std::abs(twice.dot(normal)) / 2;
  };
  const double rim_mm = 10 * std::sin(pi / 3);
  // Across the belt the body is a cylinder; along the axis a rectangle between two segments of a circle.
  for (const double z_mm : {-4.0, 0.3, 3.0})
    EXPECT_NEAR(area_mm2({0, 0, z_mm}, Eigen::Vector3d::UnitZ()), pi * rim_mm * rim_mm, 1) << z_mm;
  EXPECT_NEAR(area_mm2({0, 1e-3, 0}, Eigen::Vector3d::UnitY()),
              2 * rim_mm * 10 + 100 * (2 * pi / 3 - std::sin(2 * pi / 3)), 1);
  EXPECT_TRUE(between_rims({}, sheets[0]).triangles.empty());
}

/// A study that is not, or no longer, the one that the case was made from.
class OtherStudies : public DicomTest {
 protected:
  void SetUp() override {
    DicomTest::SetUp();
    study_ = folder_.string() + "-study";
    fs::remove_all(study_);
    test::make_fixture_case(folder_);
    test::make_fixture_study(study_);
    test::note_study(folder_, study_);
  }
  void TearDown() override {
    fs::remove_all(study_);
    DicomTest::TearDown();
  }

  void expect_refused_and_pseudonymous() {
    try {
      report(study_);
      ADD_FAILURE() << "a report under another study's name";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_THAT(error.what(), HasSubstr(study_.string()));
      EXPECT_THAT(error.what(), HasSubstr("1.2.826.0.1.3680043.10.1.2"));  // the case's series
      EXPECT_THAT(error.what(), Not(HasSubstr("DOE")));
    }
    // Where segmentation read it, and nobody has said that it is the patient's.
    report({});
    for (const char* name : {"report.dcm", "prescription.dcm", "biometry.dcm"}) {
      EXPECT_THAT(dump(name), Not(HasSubstr("DOE"))) << name;
      EXPECT_THAT(dump(name), HasSubstr("s-0a1b2c3d")) << name;
    }
    EXPECT_THROW(report({}, true), Error);
  }
  void change(const std::string& tag_and_value) {
    std::vector<std::string> words{"-nb", "-m", tag_and_value};
    for (const auto& entry : fs::directory_iterator(study_)) words.push_back(entry.path().string());
    output_of("/usr/bin/dcmodify", words);
  }

  /// In bytes of a character set that is none.
  void make_unreadable(const DcmTagKey& tag) const {
    for (const auto& entry : fs::directory_iterator(study_)) {
      DcmFileFormat format;
      ASSERT_TRUE(format.loadFile(entry.path().c_str()).good());
      format.getDataset()->putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 999");
      format.getDataset()->putAndInsertString(tag, "D\xD6\x45^JANE");
      ASSERT_TRUE(format.saveFile(entry.path().c_str(), EXS_LittleEndianExplicit).good());
    }
    test::note_study(folder_, study_);
  }

  /// As a header may have it, valid or not.
  void put_in_all(const DcmTagKey& tag, const std::string& value) const {
    for (const auto& entry : fs::directory_iterator(study_)) {
      DcmFileFormat format;
      ASSERT_TRUE(format.loadFile(entry.path().c_str()).good());
      format.getDataset()->putAndInsertString(tag, value.c_str());
      ASSERT_TRUE(format.saveFile(entry.path().c_str(), EXS_LittleEndianExplicit).good());
    }
    test::note_study(folder_, study_);
  }

  /// Sequences in sequences: what reads them by recursion does not survive it.
  void write_nested() const {
    std::string bytes(128, '\0');
    bytes += "DICM";
    for (int level = 0; level < 20'000; ++level)
      bytes += std::string("\x08\x00\x15\x11SQ\0\0\xff\xff\xff\xff\xfe\xff\x00\xe0\xff\xff\xff\xff", 20);
    write_file(study_ / "nested", bytes);
  }

  fs::path study_;
};

TEST_F(OtherStudies, AnotherPatientsOfOtherSeries) {
  change("(0010,0010)=ROE^RICHARD");
  change("(0020,000e)=1.2.826.0.1.3680043.10.1.99");
  expect_refused_and_pseudonymous();
}

TEST_F(OtherStudies, AnotherPatientsUnderTheSameUids) {
  change("(0010,0020)=MRN-OTHER");
  expect_refused_and_pseudonymous();
}

TEST_F(OtherStudies, OneSliceRemoved) {
  fs::remove(study_ / "slice3");
  expect_refused_and_pseudonymous();
}

TEST_F(OtherStudies, NoneWhereNoEyeWasSeen) {
  Json case_json = read_json(folder_ / "case.json");
  case_json["stacks"][0]["used"] = false;
  case_json["series"].push_back({{"uid", "nifti-0123"}, {"files", 1}});
  write_json(folder_ / "case.json", case_json);
  report(study_);
  EXPECT_THAT(dump("biometry.dcm"), HasSubstr("[DOE^JANE]"));
}

/// Nothing tells whose a NIfTI volume is.
TEST_F(OtherStudies, AVolumeThatWasReadIsNoPatients) {
  Json case_json = read_json(folder_ / "case.json");
  case_json["series"].push_back({{"uid", "nifti-0123"}, {"files", 1}});
  case_json["stacks"].push_back({{"uid", "nifti-0123"}, {"used", true}});
  write_json(folder_ / "case.json", case_json);
  EXPECT_THROW(report(study_), Error);
  report({});
  for (const char* name : {"report.dcm", "prescription.dcm", "biometry.dcm"}) {
    EXPECT_THAT(dump(name), Not(HasSubstr("DOE"))) << name;
    EXPECT_THAT(dump(name), HasSubstr("s-0a1b2c3d")) << name;
  }
}

/// Objects without a study are none: they could not be written.
TEST_F(OtherStudies, NoneWhereTheFilesTellNone) {
  std::vector<std::string> words{"-nb", "-e", "(0020,000d)"};
  for (const auto& entry : fs::directory_iterator(study_)) words.push_back(entry.path().string());
  output_of("/usr/bin/dcmodify", words);
  test::note_study(folder_, study_);
  try {
    report(study_);
    ADD_FAILURE() << "objects of no study";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("(0020,000d) StudyInstanceUID is absent"));
  }
  report({});
  for (const char* name : {"report.dcm", "prescription.dcm", "biometry.dcm"}) {
    EXPECT_THAT(dump(name), Not(HasSubstr("DOE"))) << name;
    EXPECT_THAT(dump(name), HasSubstr("s-0a1b2c3d")) << name;
    EXPECT_THAT(dump(name), HasSubstr("(0020,000d) UI [2.25.")) << name;
  }
}

TEST_F(OtherStudies, ANameThatCannotBeConvertedIsLeftOutAndSaid) {
  make_unreadable(DCM_PatientName);
  report(study_);
  EXPECT_THAT(dump("biometry.dcm"), HasSubstr("(0010,0010) PN (no value available)"));
  EXPECT_THAT(dump("biometry.dcm"), HasSubstr("[MRN-4711]"));
  const std::string warnings = read_json(folder_ / "report" / "stage.json").at("warnings").dump();
  EXPECT_THAT(warnings, HasSubstr("(0010,0010) PatientName: not in the character set (0008,0005)"));
  EXPECT_THAT(warnings, Not(HasSubstr("JANE")));
}

TEST_F(OtherStudies, DatesAndTimesThatAreNoneAreUnknown) {
  Json case_json = read_json(folder_ / "case.json");
  case_json["study_date"] = nullptr;
  write_json(folder_ / "case.json", case_json);
  put_in_all(DCM_PatientBirthDate, "19500230");
  put_in_all(DCM_StudyTime, "25:00");
  for (const std::string date : {"20261399", "2026.01.01"}) {
    put_in_all(DCM_StudyDate, date);
    report(study_, true);
    for (const char* name :
         {"report.dcm", "prescription.dcm", "biometry.dcm", "segmentation.dcm", "structures.dcm"}) {
      EXPECT_THAT(dump(name), HasSubstr("(0008,0020) DA (no value available)")) << name;
      EXPECT_THAT(dump(name), HasSubstr("(0008,0030) TM (no value available)")) << name;
      EXPECT_THAT(dump(name), HasSubstr("(0010,0030) DA (no value available)")) << name;
    }
    const Json fhir = read_json(folder_ / "report" / "prescription.fhir.json");
    EXPECT_FALSE(fhir.contains("created")) << date;
    EXPECT_TRUE(fhir.contains("_created")) << date;
    const std::string page = visible_text(output("report.html"));
    EXPECT_THAT(page, AllOf(Not(HasSubstr("2026-13-99")), Not(HasSubstr("1950-02-30")),
                            Not(HasSubstr("Study date"))));
    const std::string warnings = read_json(folder_ / "report" / "stage.json").at("warnings").dump();
    EXPECT_THAT(warnings,
                AllOf(HasSubstr("(0008,0020) StudyDate is no date"), HasSubstr(date),
                      HasSubstr("(0008,0030) StudyTime is no time"),
                      HasSubstr("(0010,0030) PatientBirthDate is no date"), Not(HasSubstr("1950"))));
  }
}

/// Without an ID an archive files the objects with those of anybody who has none.
TEST_F(OtherStudies, AnIdThatCannotBeConvertedIsNobodys) {
  make_unreadable(DCM_PatientID);
  try {
    report(study_);
    ADD_FAILURE() << "objects of no patient";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), HasSubstr("(0010,0020) PatientID: not in the character set (0008,0005)"));
    EXPECT_THAT(error.what(), Not(HasSubstr("JANE")));
  }
  report({});
  for (const char* name : {"report.dcm", "prescription.dcm", "biometry.dcm"}) {
    EXPECT_THAT(dump(name), Not(HasSubstr("DOE"))) << name;
    EXPECT_THAT(dump(name), HasSubstr("(0010,0020) LO [s-0a1b2c3d]")) << name;
  }
}

TEST_F(OtherStudies, AFileThatCameLaterIsNotOpened) {
  test::make_fixture_study(study_ / "later", "ROE^RICHARD");
  write_nested();
  report(study_);
  EXPECT_THAT(dump("biometry.dcm"), HasSubstr("[DOE^JANE]"));
}

TEST_F(OtherStudies, AFileThatKillsItsReaderWasThereFromTheStart) {
  write_nested();
  const fs::path file = folder_ / "segmentation" / "stage.json";
  Json stage = read_json(file);
  stage["inputs"]["study/99"] = sha256_of_file(study_ / "nested");
  write_json(file, stage);
  report(study_);
  EXPECT_THAT(dump("biometry.dcm"), HasSubstr("[DOE^JANE]"));
}

// A name that would be markup, a path or a format elsewhere is a name.
TEST_F(DicomTest, HostileIdentityStaysInsideTheObjectsAndIsShownOnlyOnDemand) {
  test::make_fixture_case(folder_);
  const fs::path study = folder_.string() + "-study";
  fs::remove_all(study);
  test::make_fixture_study(study, "../TELLING^<script>alert(4)</script>\"'%n");
  test::note_study(folder_, study);
  const std::string told = report(study).text;
  EXPECT_THAT(told, Not(HasSubstr("TELLING")));
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
    EXPECT_THAT(entry.path().string(), Not(HasSubstr("TELLING")));
    if (!entry.is_regular_file() || entry.path().extension() == ".dcm") continue;
    EXPECT_EQ(read_file(entry.path()).find("TELLING"), std::string::npos) << entry.path();
  }
  EXPECT_THAT(pdf_text(), Not(HasSubstr("TELLING")));
  EXPECT_THAT(dump("biometry.dcm"), HasSubstr("TELLING"));

  report(study, true);
  const std::string html = output("report.html");
  EXPECT_NE(html.find("&lt;script&gt;alert(4)"), std::string::npos);
  EXPECT_NE(html.find("../TELLING"), std::string::npos);
  EXPECT_EQ(html.find("<script>alert"), std::string::npos);
  EXPECT_THAT(pdf_text(), HasSubstr("TELLING"));
  EXPECT_EQ(output("stage.json").find("TELLING"), std::string::npos);
  EXPECT_EQ(output("prescription.fhir.json").find("TELLING"), std::string::npos);
  fs::remove_all(study);
}

void DicomTest::expect_the_pdf() const {
  std::string pdf = output("report.pdf");
  if (pdf.size() % 2 != 0) pdf.push_back('\0');
  EXPECT_TRUE(bytes_of("report.dcm", 0x0042, 0x0011) == pdf);
}

void DicomTest::expect_the_lenses() const {
  const std::string text =
      output_of("/usr/bin/dsrdump", {(folder_ / "report" / "prescription.dcm").string()});
  EXPECT_THAT(text, HasSubstr("Completion Flag     : PARTIAL"));
  EXPECT_THAT(text, HasSubstr("Verification Flag   : UNVERIFIED"));
  const std::string elements = dump("prescription.dcm");
  EXPECT_THAT(elements, HasSubstr("(0008,0105) CS [DCMR]"));
  EXPECT_THAT(elements, HasSubstr("(0040,db00) CS [2020]"));
  // of a standard deviation of 8 degrees
  EXPECT_THAT(elements, HasSubstr("Axis: 95 % interval \u00b1 16\u00b0, MRI"));
  for (const auto& [eye, name] : {std::pair{"od", "Right Eye Rx"}, std::pair{"os", "Left Eye Rx"}}) {
    const Json rounded = read_json(folder_ / "correction" / eye / "prescription.json").at("rounded");
    const std::size_t from = text.find(name);
    ASSERT_NE(from, std::string::npos);
    const std::string lens = text.substr(from, text.find("CONTAINER", from) - from);
    const auto number = [&](const char* concept_name) {
      const std::size_t at = lens.find("\"" + std::string(concept_name) + "\")=\"");
      return std::stod(lens.substr(at + std::strlen(concept_name) + 5));
    };
    EXPECT_EQ(number("Sphere"), rounded.at("sphere_D").get<double>());
    EXPECT_EQ(number("Cylinder"), rounded.at("cylinder_D").get<double>());
    EXPECT_EQ(number("Axis"), rounded.at("axis_deg").get<double>());
  }
}

// The fixture's left cornea has 0.34 +-0.59 D of cylinder, its right one 2.25 D.
void DicomTest::expect_a_note_of_axes_that_are_none() const {
  const std::string text = dump("biometry.dcm"), note = "cylinder may be none: its axes are not determined";
  const std::size_t at = text.find(note);
  ASSERT_NE(at, std::string::npos);
  EXPECT_GT(at, text.find("OS (left eye)"));
  EXPECT_EQ(text.find(note, at + 1), std::string::npos);
}

// SNOMED CT: what each label is, and whose.
void DicomTest::expect_coded_segments() const {
  std::istringstream lines(dump("segmentation.dcm"));
  std::map<std::string, std::set<std::string>> codes;
  std::string label;
  for (std::string line; std::getline(lines, line);) {
    const auto value = [&] {
      const std::size_t from = line.find('[') + 1;
      return line.substr(from, line.find(']') - from);
    };
    if (line.find("(0062,0005)") != std::string::npos) label = value();
    if (line.find("(5200,9229)") != std::string::npos) break;  // segments are done
    if (!label.empty() && line.find("(0008,0100)") != std::string::npos) codes[label].insert(value());
  }
  const std::map<std::string, std::string> expected{{"cornea", "28726007"},
                                                    {"anterior chamber", "31636006"},
                                                    {"lens", "78076003"},
                                                    {"vitreous body", "372242005"},
                                                    {"sclera, choroid and retina", "18619003"}};
  ASSERT_EQ(codes.size(), 2 * expected.size());
  for (const auto& [structure, code] : expected) {
    EXPECT_THAT(codes["right " + structure], ::testing::IsSupersetOf({code, std::string("24028007")}));
    EXPECT_THAT(codes["left " + structure], ::testing::IsSupersetOf({code, std::string("7771000")}));
  }
}

void DicomTest::expect_every_labelled_voxel() const {
  const std::string frames = bytes_of("segmentation.dcm", 0x7fe0, 0x0010);
  std::size_t marked = 0;
  for (const char byte : frames)
    marked += static_cast<std::size_t>(__builtin_popcount(static_cast<unsigned char>(byte)));
  const std::string volume =
      output_of("/bin/sh", {"-c", "gzip -dc \"$1\" | tail -c +353", "sh",
                            (folder_ / "segmentation" / "stack1_labels.nii.gz").string()});
  EXPECT_GT(marked, 1000U);
  EXPECT_EQ(marked, static_cast<std::size_t>(
                        std::count_if(volume.begin(), volume.end(), [](char c) { return c != 0; })));
}

void DicomTest::expect_the_mesh() const {
  EXPECT_THAT(dump("dicom/os_retina.dcm"), HasSubstr("[mm]"));
  const std::string stl = bytes_of("dicom/os_retina.dcm", 0x0042, 0x0011);
  const TriangleMesh mesh = read_mesh(folder_ / "meshing" / "os" / "retina.ply").mesh;
  std::uint32_t count = 0;
  std::memcpy(&count, stl.data() + 80, 4);
  ASSERT_EQ(count, mesh.triangles.size());
  ASSERT_GE(stl.size(), 84 + std::size_t{50} * count);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t corner = 0; corner < 3; ++corner) {
      std::array<float, 3> point{};
      std::memcpy(point.data(), stl.data() + 84 + 50 * i + 12 + 12 * corner, 12);
      const Eigen::Vector3d& expected = mesh.vertices[static_cast<std::size_t>(mesh.triangles[i][corner])];
      for (int axis = 0; axis < 3; ++axis) ASSERT_NEAR(point[axis], expected[axis], 1e-4);
    }
}

void DicomTest::expect_the_picture() const {
  cv::Mat picture = cv::imread((folder_ / "correction" / "od" / "corrected.png").string(), cv::IMREAD_COLOR);
  const std::string pixels = bytes_of("dicom/od_corrected.dcm", 0x7fe0, 0x0010);
  ASSERT_EQ(pixels.size(), picture.total() * 3);
  for (std::size_t i = 0; i < pixels.size(); ++i)  // RGB against OpenCV's BGR
    ASSERT_EQ(static_cast<unsigned char>(pixels[i]), picture.data[i / 3 * 3 + 2 - i % 3]);
}

TEST_F(DicomTest, ObjectsHoldWhatTheCaseHolds) {
  test::make_fixture_case(folder_);
  report();
  expect_the_pdf();
  expect_the_lenses();
  expect_a_note_of_axes_that_are_none();
  expect_coded_segments();
  expect_every_labelled_voxel();
  expect_the_mesh();
  expect_the_picture();
}

TEST_F(DicomTest, ASegmentationThatCannotBeWrittenTakesNoOtherWithIt) {
  test::make_fixture_case(folder_);
  fs::copy_file(folder_ / "segmentation" / "stack1.nii.gz", folder_ / "segmentation" / "stack0.nii.gz");
  write_file(folder_ / "segmentation" / "stack0_labels.nii.gz", "no volume");
  const CaseData data = read_case(folder_, LateralityChoice::both);
  const fs::path objects = folder_ / "objects";
  Notes notes;
  write_objects(objects, data, SourceStudy::pseudonymous(data.subject(), data.study_date()), "%PDF", false,
                notes);
  EXPECT_THAT(notes, ::testing::ElementsAre(HasSubstr("segmentation.dcm was not written")));
  EXPECT_FALSE(fs::exists(objects / "segmentation.dcm"));
  EXPECT_TRUE(fs::exists(objects / "segmentation_2.dcm"));
}

TEST_F(DicomTest, SegmentationsAreOfTheEyesThatAreAskedFor) {
  test::make_fixture_case(folder_);
  CommonOptions common;
  common.verbosity.quiet = true;
  common.laterality = LateralityChoice::od;
  write_report({folder_, {}, false}, common);
  EXPECT_THAT(dump("segmentation.dcm"), AllOf(HasSubstr("[right lens]"), Not(HasSubstr("[left "))));

  // Of a stack with labels of one eye alone the other has no file.
  const CaseData left = read_case(folder_, LateralityChoice::os);
  const fs::path names = folder_ / "segmentation" / "labels.json";
  Json labels = read_json(names);
  for (Json& label : labels["labels"]) label["name"] = "right eye";
  write_json(names, labels);
  Notes notes;
  write_objects(folder_ / "objects", left, SourceStudy::pseudonymous(left.subject(), ""), "%PDF", false,
                notes);
  EXPECT_TRUE(fs::exists(folder_ / "objects" / "biometry.dcm"));
  EXPECT_FALSE(fs::exists(folder_ / "objects" / "segmentation.dcm"));
  EXPECT_THAT(notes, ::testing::IsEmpty());
}

}  // namespace
}  // namespace emmetrope::report
