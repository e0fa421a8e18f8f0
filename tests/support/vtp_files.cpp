#include "tests/support/vtp_files.hpp"

#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>

#include "pipeline/eye/meshes/mesh_formats.hpp"

namespace emmetrope::testing_eye {

namespace {

struct Storage {
  std::string name;
  int mode = vtkXMLWriter::Appended;
  bool is_raw = false, is_long = false, is_big_endian = false;
  int packing = vtkXMLWriter::ZLIB;
};

std::string written(vtkPolyData* data, const Storage& storage) {
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(data);
  writer->WriteToOutputStringOn();
  writer->SetBlockSize(1024);  // several blocks an array
  writer->SetDataMode(storage.mode);
  writer->SetEncodeAppendedData(storage.is_raw ? 0 : 1);
  writer->SetHeaderType(storage.is_long ? vtkXMLWriter::UInt64 : vtkXMLWriter::UInt32);
  writer->SetByteOrder(storage.is_big_endian ? vtkXMLWriter::BigEndian : vtkXMLWriter::LittleEndian);
  writer->SetCompressorType(storage.packing);
  writer->Write();
  return writer->GetOutputString();
}

}  // namespace

std::map<std::string, std::string> vtp_files(const TriangleMesh& mesh) {
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->ReadFromInputStringOn();
  reader->SetInputString(format_vtp(mesh, true));
  reader->Update();
  // VTK would write fields' bytes raw between the tags, which no reader of XML accepts.
  vtkNew<vtkPolyData> without_fields;
  without_fields->ShallowCopy(reader->GetOutput());
  without_fields->SetFieldData(vtkNew<vtkFieldData>());

  std::map<std::string, std::string> files;
  for (Storage storage :
       {Storage{"ascii", vtkXMLWriter::Ascii}, Storage{"binary", vtkXMLWriter::Binary},
        Storage{"appended", vtkXMLWriter::Appended}, Storage{"raw", vtkXMLWriter::Appended, true}})
    for (const bool is_long : {false, true})
      for (const bool is_big_endian : {false, true})
        for (const bool is_packed : {false, true}) {
          storage.is_long = is_long;
          storage.is_big_endian = is_big_endian;
          storage.packing = is_packed ? vtkXMLWriter::ZLIB : vtkXMLWriter::NONE;
          const std::string name = storage.name + (is_long ? ", long" : "") +
                                   (is_big_endian ? ", big-endian" : "") + (is_packed ? ", packed" : "");
          files[name] = written(storage.is_raw ? without_fields.Get() : reader->GetOutput(), storage);
        }
  Storage other;
  other.packing = vtkXMLWriter::LZ4;
  files["lz4"] = written(reader->GetOutput(), other);
  return files;
}

}  // namespace emmetrope::testing_eye
