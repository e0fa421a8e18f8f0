# Draws docs/evidence/mesh-convergence.png: bin/mesh_accuracy >mesh.csv; gnuplot -e "data='mesh.csv'; picture='docs/evidence/mesh-convergence.png'" THIS
set terminal pngcairo size 760,500 font "DejaVu Sans,11"
set output picture
set datafile separator ","
set logscale xy
set format y "%g"
set xrange [450:65000]
set yrange [3e-5:2]
set xlabel "vertices a surface (cornea with coma and trefoil)"
set ylabel "exit direction, rms arcmin"
set grid
set key at graph 0.62, graph 0.42 top right
irregular(vertices) = stringcolumn(1) eq "irregular" ? vertices : NaN
plot data using (irregular($2)):4 with linespoints lw 2 pt 5 title "triangles, normals estimated from the mesh", \
     data using (irregular($2)):3 with linespoints lw 2 pt 7 title "triangles, the surface's normals", \
     data using (irregular($2)):5 with linespoints lw 2 pt 9 title "smooth", \
     1 with lines dt 2 lc "gray40" title "1 arcmin: detail of 20/20 vision"
