"""Pictures as xarray's, whose axes have names and units in them (python3-xarray)."""


def _coordinates(axes):
    (column, columns), (row, rows) = axes.items()
    return (row, column), {row: rows, column: columns}


def picture(self):
    """A DataArray (rows, columns, channel) of linear light; no number where the eye sees nothing."""
    import numpy
    import xarray
    dimensions, coordinates = _coordinates(self.axes)
    light = numpy.where(self.seen[..., None], self.linear, numpy.nan)
    return xarray.DataArray(light, {**coordinates, "channel": ["red", "green", "blue"]}, (*dimensions, "channel"),
                            name="linear_light")


def irradiance(self):
    """A Dataset of irradiance (wavelength_nm, rows, columns), cones (rows, columns, cone) and trolands; no number where
    the eye sees nothing."""
    import xarray
    dimensions, coordinates = _coordinates(self.axes)
    dataset = xarray.Dataset(
        {"irradiance": (("wavelength_nm", *dimensions), self.irradiance, {"units": "W / (m^2 nm)"}),
         "cones": ((*dimensions, "cone"), self.cones, {"units": "W / m^2"}),
         "trolands": (dimensions, self.trolands, {"units": "td"}),
         "transmittance": ("wavelength_nm", self.transmittance)},
        {**coordinates, "wavelength_nm": self.wavelength_nm, "cone": ["L", "M", "S"]})
    seen = xarray.DataArray(self.seen, dims=dimensions)
    for name in ("irradiance", "cones", "trolands"):
        dataset[name] = dataset[name].where(seen)
    return dataset
