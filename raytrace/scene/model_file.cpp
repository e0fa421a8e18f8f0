#include "raytrace/scene/model_file.hpp"

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "raytrace/scene/picture.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr std::size_t most_triangles = 5'000'000;
constexpr float crease_deg = 60;

Eigen::Vector3d vector(const aiVector3D& v) { return {v.x, v.y, v.z}; }

std::string lower_ending(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending;
}

/// Assimp makes room for whatever length a GLB file's first chunk, its JSON, claims (glTF 2.0, 4.4; little endian, as all
/// machines that this runs on).
void check_glb_header(const std::filesystem::path& file) {
  constexpr std::size_t header_bytes = 12, chunk_header_bytes = 8;
  const std::string bytes = read_file(file);
  std::uint32_t json_bytes = 0;
  if (bytes.size() >= header_bytes + chunk_header_bytes)
    std::memcpy(&json_bytes, bytes.data() + header_bytes, sizeof json_bytes);
  if (bytes.size() < header_bytes + chunk_header_bytes ||
      json_bytes > bytes.size() - header_bytes - chunk_header_bytes)
    throw input_error(file.string() + " ends before what its header promises",
                      "copy or export the file again");
}

/// Notes what the importer reads; what it looks for in vain is no input.
class NotingFiles : public Assimp::DefaultIOSystem {
 public:
  explicit NotingFiles(std::vector<std::filesystem::path>& files) : files_(files) {}
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    Assimp::IOStream* stream = DefaultIOSystem::Open(file, mode);
    if (stream != nullptr && std::find(files_.begin(), files_.end(), file) == files_.end())
      files_.emplace_back(file);
    return stream;
  }

 private:
  std::vector<std::filesystem::path>& files_;
};

/// A texture from inside the file (GLB) or from beside it.
std::shared_ptr<const Texture> texture_of(const aiScene& scene, const aiString& path,
                                          const std::filesystem::path& file,
                                          std::vector<std::filesystem::path>& files) {
  const aiTexture* inside = scene.GetEmbeddedTexture(path.C_Str());
  if (inside == nullptr) {
    files.push_back(file.parent_path() / path.C_Str());
    return read_picture(files.back());
  }
  if (inside->mHeight == 0)
    return decode_picture({reinterpret_cast<const char*>(inside->pcData), inside->mWidth},
                          file.string() + ": its picture " + path.C_Str());
  Texture texture{static_cast<int>(inside->mWidth), static_cast<int>(inside->mHeight), 3, {}};
  for (unsigned i = 0; i < inside->mWidth * inside->mHeight; ++i)
    for (const unsigned char value : {inside->pcData[i].r, inside->pcData[i].g, inside->pcData[i].b})
      texture.values.push_back(linear_light(value));
  return std::make_shared<const Texture>(std::move(texture));
}

Material material_of(const aiScene& scene, const aiMaterial& from, const std::filesystem::path& file,
                     std::vector<std::filesystem::path>& files) {
  Material material;
  aiColor4D colour;
  if (from.Get(AI_MATKEY_BASE_COLOR, colour) == AI_SUCCESS ||
      from.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == AI_SUCCESS)
    material.colour = {colour.r, colour.g, colour.b};
  aiString path;
  if (from.GetTexture(aiTextureType_BASE_COLOR, 0, &path) == AI_SUCCESS ||
      from.GetTexture(aiTextureType_DIFFUSE, 0, &path) == AI_SUCCESS) {
    material.texture = texture_of(scene, path, file, files);
  }
  float shininess = 0;
  if (from.Get(AI_MATKEY_COLOR_SPECULAR, colour) == AI_SUCCESS &&
      from.Get(AI_MATKEY_SHININESS, shininess) == AI_SUCCESS && shininess > 0) {
    material.specular = (colour.r + colour.g + colour.b) / 3;
    material.shininess = shininess;
  }
  return material;
}

MeshObject object_of(const aiMesh& mesh, const Material& material, bool colours_are_encoded) {
  MeshObject object;
  object.material = material;
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    object.positions_mm.push_back(vector(mesh.mVertices[i]));
    object.normals.push_back(mesh.HasNormals() ? vector(mesh.mNormals[i]) : Eigen::Vector3d::UnitZ());
    if (mesh.HasTextureCoords(0))
      object.texture_coordinates.emplace_back(mesh.mTextureCoords[0][i].x, mesh.mTextureCoords[0][i].y);
    if (mesh.HasVertexColors(0)) {
      const aiColor4D& c = mesh.mColors[0][i];
      const auto light = [&](float v) {
        return colours_are_encoded ? linear_light(static_cast<unsigned char>(std::lround(255 * v))) : v;
      };
      object.colours.emplace_back(light(c.r), light(c.g), light(c.b));
    }
  }
  for (unsigned k = 0; k < mesh.mNumFaces; ++k) {
    const unsigned* corner = mesh.mFaces[k].mIndices;
    if (mesh.mFaces[k].mNumIndices == 3)
      object.triangles.push_back(
          {static_cast<int>(corner[0]), static_cast<int>(corner[1]), static_cast<int>(corner[2])});
  }
  return object;
}

/// What makes the meshes unusable; empty where nothing does.
std::string fault_of(const aiScene& scene) {
  if (scene.mNumMeshes == 0) return " holds no triangles";
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const aiMesh& mesh = *scene.mMeshes[i];
    if (mesh.mNumFaces == 0) return " has a mesh without faces";
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      if (!vector(mesh.mVertices[v]).allFinite()) return " has a vertex that is no number";
    for (unsigned k = 0; k < mesh.mNumFaces; ++k) {
      if (mesh.mFaces[k].mNumIndices == 0) return " has a face without corners";
      for (unsigned c = 0; c < mesh.mFaces[k].mNumIndices; ++c)
        if (mesh.mFaces[k].mIndices[c] >= mesh.mNumVertices)
          return " has a face with vertex " + std::to_string(mesh.mFaces[k].mIndices[c]) + " of " +
                 std::to_string(mesh.mNumVertices);
    }
  }
  return {};
}

}  // namespace

std::vector<MeshObject> read_model(const std::filesystem::path& file,
                                   std::vector<std::filesystem::path>* files) {
  static const std::set<std::string> endings{".obj", ".ply", ".stl", ".gltf", ".glb"};
  const std::string ending = lower_ending(file);
  if (endings.count(ending) == 0)
    throw unsupported_error(file.string() + ": models of this ending are not read",
                            "use OBJ, PLY, STL, glTF or GLB");
  if (!is_file(file)) throw input_error("there is no file " + file.string());

  // Assimp takes 1.7 in a PLY face for the vertices 1 and 0, and never comes back from a header without an end.
  if (ending == ".ply") read_mesh(file);
  if (ending == ".glb") check_glb_header(file);

  std::vector<std::filesystem::path> read;
  Assimp::Importer importer;
  importer.SetIOHandler(new NotingFiles(read));  // which the importer owns
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, crease_deg);
  // Validated before anything else works on it: later steps take good indices for granted.
  const aiScene* scene = importer.ReadFile(file.string(), aiProcess_ValidateDataStructure);
  if (scene != nullptr) {
    if (const std::string wrong = fault_of(*scene); !wrong.empty()) throw input_error(file.string() + wrong);
    scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_GenSmoothNormals |
                                         aiProcess_JoinIdenticalVertices | aiProcess_PreTransformVertices |
                                         aiProcess_SortByPType);
  }
  if (scene == nullptr)
    throw input_error(file.string() + " cannot be read: " + importer.GetErrorString(),
                      "export it again as OBJ, PLY or glTF");
  std::vector<MeshObject> objects;
  std::size_t triangles = 0;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) {
    const aiMesh& mesh = *scene->mMeshes[i];
    objects.push_back(object_of(
        mesh, material_of(*scene, *scene->mMaterials[mesh.mMaterialIndex], file, read), ending == ".ply"));
    triangles += objects.back().triangles.size();
  }
  if (triangles == 0) throw input_error(file.string() + " holds no triangles");
  if (triangles > most_triangles)
    throw input_error(file.string() + " holds " + std::to_string(triangles) + " triangles",
                      "reduce it to 5 million");
  if (files != nullptr) files->insert(files->end(), read.begin(), read.end());
  return objects;
}

}  // namespace emmetrope::raytrace
