#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "tests/support/sheet.hpp"
#include "tests/support/vtp_files.hpp"

namespace emmetrope {
namespace {

std::filesystem::path scratch(const std::string& name) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("emmetrope-mesh-files-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  return folder / name;
}

TriangleMesh sheet() { return testing_eye::jittered_sheet(*make_sphere(7.8), 4, 120, 5); }

TEST(MeshFiles, EveryFormatReadsBack) {
  const TriangleMesh mesh = sheet();
  for (const char* ending : {"ply", "obj", "vtp"})
    for (const bool says_lps : {false, true}) {
      const std::filesystem::path file = scratch(std::string("round.") + ending);
      write_mesh(file, mesh, says_lps);
      const MeshFile again = read_mesh(file);
      EXPECT_EQ(again.says_lps, says_lps) << ending;
      ASSERT_EQ(again.mesh.vertices.size(), mesh.vertices.size()) << ending;
      EXPECT_EQ(again.mesh.triangles, mesh.triangles) << ending;
      ASSERT_EQ(again.mesh.normals.size(), mesh.normals.size()) << ending;
      for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
        EXPECT_EQ(again.mesh.vertices[k], mesh.vertices[k]) << ending;
        EXPECT_LT((again.mesh.normals[k] - mesh.normals[k]).norm(), 1e-15) << ending;
      }
    }
}

TEST(MeshFiles, StlWeldsItsCorners) {
  const TriangleMesh mesh = sheet();
  write_mesh(scratch("round.stl"), mesh, true);
  const MeshFile again = read_mesh(scratch("round.stl"));
  EXPECT_TRUE(again.says_lps);
  EXPECT_EQ(again.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_LE(again.mesh.vertices.size(), mesh.vertices.size());
  EXPECT_LT((again.mesh.vertices[again.mesh.triangles[3][1]] - mesh.vertices[mesh.triangles[3][1]]).norm(),
            1e-6);
}

TEST(MeshFiles, OfAnotherSpaceSaySo) {
  for (const char* ending : {"ply", "stl", "obj"}) {
    const std::filesystem::path file = scratch(std::string("space.") + ending);
    write_mesh(file, sheet(), true);
    EXPECT_FALSE(read_mesh(file).says_ras) << ending;
    std::string bytes = read_file(file);
    write_file(file, bytes.replace(bytes.find("SPACE=LPS"), 9, "SPACE=RAS"));
    EXPECT_TRUE(read_mesh(file).says_ras) << ending;
    EXPECT_FALSE(read_mesh(file).says_lps) << ending;
  }
  write_file(
      scratch("space.vtp"),
      "<VTKFile type=\"PolyData\" version=\"1.0\"><PolyData><FieldData><Array type=\"String\" "
      "Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">82 65 83 0</Array></FieldData><Piece "
      "NumberOfPoints=\"1\" NumberOfPolys=\"0\"><Points><DataArray type=\"Float32\" "
      "NumberOfComponents=\"3\" format=\"ascii\">0 0 0</DataArray></Points></Piece></PolyData></VTKFile>");
  EXPECT_TRUE(read_mesh(scratch("space.vtp")).says_ras);
}

TEST(MeshFiles, TextFormsAreRead) {
  write_file(scratch("text.ply"),
             "ply\nformat ascii 1.0\ncomment SPACE=LPS\nelement vertex 4\nproperty float x\nproperty float "
             "y\nproperty float z\n"
             "property uchar label\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0 1\n1 0 0 1\n1 1 0.5 2\n0 1 0 3\n4 0 1 2 3\n");
  const MeshFile ply = read_mesh(scratch("text.ply"));
  EXPECT_TRUE(ply.says_lps);
  EXPECT_EQ(ply.mesh.triangles.size(), 2u);
  EXPECT_EQ(ply.mesh.vertices[2], Eigen::Vector3d(1, 1, 0.5));
  write_file(scratch("text.stl"),
             "solid sheet SPACE=LPS\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
             "0\nendloop\nendfacet\n"
             "facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 "
             "0\nendloop\nendfacet\nendsolid sheet\n");
  const MeshFile stl = read_mesh(scratch("text.stl"));
  EXPECT_TRUE(stl.says_lps);
  EXPECT_EQ(stl.mesh.vertices.size(), 4u);
  write_file(scratch("text.obj"), "# plain\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n");
  EXPECT_EQ(read_mesh(scratch("text.obj")).mesh.triangles.size(), 2u);
}

TEST(MeshFiles, BigEndianPlyIsRead) {
  std::string bytes =
      "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
      "float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const auto big = [&](auto value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(std::string(std::rbegin(raw), std::rend(raw)));
  };
  for (const float v : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 2.5f, 0.f}) big(v);
  bytes.push_back(3);
  for (const int i : {0, 1, 2}) big(i);
  write_file(scratch("big.ply"), bytes);
  EXPECT_EQ(read_mesh(scratch("big.ply")).mesh.vertices[2].y(), 2.5);
}

TEST(MeshFiles, CutFilesAreRefusedByName) {
  const TriangleMesh mesh = sheet();
  for (const char* ending : {"ply", "stl", "vtp"}) {
    write_mesh(scratch(std::string("whole.") + ending), mesh, false);
    const std::string bytes = read_file(scratch(std::string("whole.") + ending));
    for (const double part : {0.05, 0.5, 0.95}) {
      const std::filesystem::path file = scratch(std::string("cut.") + ending);
      write_file(file, bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size()))));
      try {
        read_mesh(file);
        ADD_FAILURE() << ending << part;
      } catch (const Error& error) {
        EXPECT_EQ(error.status(), ExitStatus::input_invalid);
        EXPECT_THAT(error.what(), testing::HasSubstr(file.filename().string()));
      }
    }
  }
}

TEST(MeshFiles, VtpIsReadHoweverItIsStored) {
  const TriangleMesh mesh = sheet();
  const auto files = testing_eye::vtp_files(mesh);
  ASSERT_EQ(files.size(), 33);
  for (const auto& [name, bytes] : files) {
    write_file(scratch("stored.vtp"), bytes);
    if (name == "lz4") {
      EXPECT_THAT([] { read_mesh(scratch("stored.vtp")); },
                  testing::ThrowsMessage<Error>(testing::HasSubstr("packed by vtkLZ4DataCompressor")));
      continue;
    }
    const MeshFile again = read_mesh(scratch("stored.vtp"));
    EXPECT_EQ(again.says_lps, name.find("raw") == std::string::npos) << name;
    EXPECT_EQ(again.mesh.triangles, mesh.triangles) << name;
    ASSERT_EQ(again.mesh.vertices.size(), mesh.vertices.size()) << name;
    ASSERT_EQ(again.mesh.normals.size(), mesh.normals.size()) << name;
    const double rounding_mm = name.find("ascii") == std::string::npos ? 0 : 1e-10;
    for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
      ASSERT_LE((again.mesh.vertices[k] - mesh.vertices[k]).norm(), rounding_mm) << name;
      ASSERT_LE((again.mesh.normals[k] - mesh.normals[k]).norm(), 1e-9) << name;
    }
  }
}

TEST(MeshFiles, PiecesOfVtpAreOneMeshAndFoursAreTwoTriangles) {
  const std::string piece =
      "<Piece NumberOfPoints=\"4\" NumberOfPolys=\"1\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" "
      "format=\"ascii\">0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points><Polys><DataArray type=\"Int32\" "
      "Name=\"connectivity\" format=\"ascii\">0 1 2 3</DataArray><DataArray type=\"Int32\" Name=\"offsets\" "
      "format=\"ascii\">4</DataArray></Polys></Piece>";
  const auto file = [](const std::string& inside) {
    return "<VTKFile type=\"PolyData\" version=\"1.0\"><PolyData>" + inside + "</PolyData></VTKFile>";
  };
  write_file(scratch("pieces.vtp"), file(piece + piece));
  const TriangleMesh mesh = read_mesh(scratch("pieces.vtp")).mesh;
  EXPECT_EQ(mesh.vertices.size(), 8);
  EXPECT_THAT(mesh.triangles, testing::ElementsAre(std::array{0, 1, 2}, std::array{0, 2, 3},
                                                   std::array{4, 5, 6}, std::array{4, 6, 7}));

  const auto refused = [&](const std::string& whole, const std::string& broken, const char* said) {
    std::string bytes = file(piece);
    bytes.replace(bytes.find(whole), whole.size(), broken);
    write_file(scratch("broken.vtp"), bytes);
    EXPECT_THAT([] { read_mesh(scratch("broken.vtp")); },
                testing::ThrowsMessage<Error>(testing::HasSubstr(said)));
  };
  refused("0 1 2 3", "0 1 2 4", "names point 4 of 4");
  refused("0 1 2 3", "0 1 2 -1", "-1 as an index");
  refused(">4<", ">5<", "out of order");
  refused("NumberOfPoints=\"4\"", "NumberOfPoints=\"5\"", "4 where it says NumberOfPoints=\"5\"");
  refused("0 1 0<", "0 one 0<", "no number");
  refused("Float32\" NumberOfComponents=\"3", "Float32\" NumberOfComponents=\"2", "three coordinates");
  refused("</Polys>", "", "no readable VTK file");
  refused("PolyData>", "UnstructuredGrid>", "no readable VTK file");
}

/// Numbers of vertices and lengths of lists may be stored as floating point, in which NaN and fractions are no numbers;
/// other lists hold what they like.
TEST(MeshFiles, PlyNumbersOfVerticesAreWhole) {
  const auto written = [](const std::string& list, double length, const std::vector<double>& corners) {
    std::string bytes =
        "ply\nformat binary_little_endian 1.0\ncomment SPACE=LPS\nelement vertex 3\nproperty uchar x\n"
        "property uchar y\nproperty uchar z\nelement face 1\nproperty list double double " +
        list + "\nend_header\n" + std::string("\0\0\0\1\0\0\0\1\0", 9);
    const auto append = [&](double value) {
      bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    append(length);
    std::for_each(corners.begin(), corners.end(), append);
    write_file(scratch("float.ply"), bytes);
    return scratch("float.ply");
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(read_mesh(written("vertex_indices", 3, {0, 1, 2})).mesh.triangles.size(), 1U);
  for (const double wrong : {nan, 0.5, 1e300, -nan})
    EXPECT_THROW(read_mesh(written("vertex_indices", 3, {0, 1, wrong})), Error) << wrong;
  for (const double wrong : {nan, 3.5})
    EXPECT_THROW(read_mesh(written("vertex_indices", wrong, {0, 1, 2})), Error) << wrong;
  EXPECT_TRUE(read_mesh(written("texcoord", 3, {0.25, 0.5, nan})).mesh.triangles.empty());
}

TEST(MeshFiles, LyingHeadersAreRefusedWithoutMemory) {
  const auto refused = [](const char* name, const std::string& bytes) {
    write_file(scratch(name), bytes);
    EXPECT_THROW(read_mesh(scratch(name)), Error) << bytes.substr(0, 60);
  };
  const std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex ";
  const std::string rest = "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
  refused("lie.ply", header + "4000000000000" + rest);
  refused("lie.ply", header + "-3" + rest);
  refused("lie.ply", header + "1e3" + rest);
  refused("lie.ply",
          "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty list uint int "
          "vertex_indices\nend_header\n\x01");
  std::string stl(84, ' ');
  stl[80] = stl[81] = stl[82] = stl[83] = '\xff';
  refused("lie.stl", stl);
  refused("lie.obj", "v 0 0 0\nf 1 2 3\n");
  refused("lie.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  refused("lie.obj", "v 0 0\n");
  refused(
      "lie.vtp",
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\"><PolyData><Piece "
      "NumberOfPoints=\"2147483647\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
      "NumberOfPolys=\"1\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 "
      "0</DataArray></Points></Piece></PolyData></VTKFile>");
  EXPECT_THROW(read_mesh(scratch("no.such")), Error);
}

TEST(MeshFiles, RandomDamageNeverCrashes) {
  std::mt19937 random(11);
  const TriangleMesh mesh = testing_eye::jittered_sheet(*make_sphere(7.8), 4, 30, 5);
  for (const char* ending : {"ply", "stl", "obj", "vtp"}) {
    const std::filesystem::path file = scratch(std::string("damaged.") + ending);
    write_mesh(file, mesh, false);
    const std::string whole = read_file(file);
    for (int k = 0; k < 200; ++k) {
      std::string bytes = whole;
      for (int n = 0; n < 3; ++n) bytes[random() % bytes.size()] = static_cast<char>(random());
      std::ofstream(file, std::ios::binary) << bytes;
      try {
        for (const auto& v : read_mesh(file).mesh.vertices) ASSERT_TRUE(v.allFinite());
      } catch (const Error&) {
      }
    }
  }
}

}  // namespace
}  // namespace emmetrope
